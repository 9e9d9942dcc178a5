"""Times from losing an operator to the stop, for eight kinds of loss.

In a round of trials, one page drives each robot, all in parallel; then all pages vanish.
Each motion value is the send time of its tick, so the robots' logs contain all results.
"""

import random
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from bench.rig.operator_process import Plan
from bench.rig.programs import SERVER_ADDRESS, Heard, Operators, Relay, Robots, Server

__all__ = ["BOUND_MS", "DEATHS", "LEASE_MS", "LINK_DEATHS", "Rig", "Trial", "robot_profile"]

LEASE_MS = 250.0
BOUND_MS = LEASE_MS + 50.0
"""Longest time from the last accepted tick to the first byte of the stop, in milliseconds."""
LINK_DEATHS = ("black-hole", "interface-down")
"""Kinds of loss that need the relay."""
DEATHS = ("close", "kill", "freeze", "block", "reset", "kick", *LINK_DEATHS)
HEALED_S = 0.4
"""Time after the link is restored during which no motion may reach the robot, in seconds."""
STOP_WITHIN_S = 3.0
LIFE_S = 600.0
LOOK_NS = 25_000_000
"""Longest time from the end of a wait for a processor until the wait is reported, in
nanoseconds."""
WITNESSES = 2
"""Number of idle programs that measure late wake-ups, as an estimate of the server's delays."""

_PROFILE = """\
urc: 1
kind: robot
name: robot-{index}
title: Robot {index}
summary: A robot of the rig. It stamps what it hears.
transports:
  wire: {{ type: {kind}, host: {host}, port: {port}, framing: {{ type: {framing} }} }}
commands:
  go:
{command}
    hold: {{ repeat: 50ms, lease: 250ms, release: {release}, watchdog: none }}
"""
_SPEED = """\
    send: "M {{ t }}"
    args: { t: { type: integer, min: 0 } }"""
_MARK = """\
    send: "M {{ 0 if t < 0 else t }}"
    args: { t: { type: integer, min: -1, default: -1 } }"""


def robot_profile(
    index: int, host: str, port: int, kind: str = "tcp", *, is_speed: bool = True
) -> str:
    """Return the document of a robot in the rig; ``M TIME`` moves the robot, ``M 0`` stops it.

    Without `is_speed`, the time is no speed, so a slow link does not change it.
    """
    framing = "delimiter, tx: LF, rx: LF" if kind == "tcp" else "datagram"
    command, release = (_SPEED, "{ t: 0 }") if is_speed else (_MARK, "{}")
    return _PROFILE.format(
        index=index, kind=kind, host=host, port=port, framing=framing, command=command,
        release=release,
    )  # fmt: skip


class Trial(NamedTuple):
    """The result of a trial with one vanished operator."""

    death: str
    stop_ms: float
    """Time from the last effective tick to the first byte of the stop, in milliseconds."""
    fault: str
    """Violation, or ""."""
    late_ms: float
    """Delay caused by the machine, in milliseconds.

    The value is the sum of two delays. The first delay is the longest wake-up delay of the robots'
    process. The second delay is the longest wake-up delay of an idle program, or the waits for a
    processor on a tick's path, if longer. This path leads through page, relay, server and guard.
    """
    bound_ms: float = BOUND_MS
    has_moved: bool = True
    """Whether the robot moved before the failure; if False, the trial is invalid."""

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> Self:
        """Return the trial with the fields of a stored row."""
        return cls(**row)

    @property
    def is_good(self) -> bool:
        """Whether the trial complied with the motion contract."""
        return not self.fault and self.stop_ms <= self.bound_ms

    @property
    def is_excused(self) -> bool:
        """Whether the machine's delay makes the trial invalid."""
        if not self.has_moved:
            return True
        return not self.fault and 0 < self.stop_ms - self.bound_ms <= self.late_ms


class Rig:
    """A rig with robots, a real server, pages that vanish, and optionally a relay."""

    module = "urc.cli.main"
    """Program that runs the server; see `bench.rig.programs.Server`."""

    def __init__(
        self,
        folder: Path,
        *,
        robot_count: int = 20,
        has_relay: bool = False,
        options: Sequence[str] = (),
        inside: Sequence[str] = (),
    ) -> None:
        """Start everything.

        Args:
            folder: folder for the robots' documents and the server's data.
            robot_count: number of robots and of parallel pages.
            has_relay: whether a relay connects pages and server; a relay needs root.
            options: additional options for ``urc serve``.
            inside: words to put before the server's command, to start it in another network
                namespace.
        """
        self._dice = random.Random(5)  # noqa: S311 - the same phases in every run
        self._numbers = 0
        self._programs = ExitStack()
        try:
            enter = self._programs.enter_context
            self.relay = enter(Relay()) if has_relay else None
            here = self.relay.inside("a") if self.relay else ()
            there = self.relay.inside("b") if self.relay else ()
            self.host = SERVER_ADDRESS if self.relay else "127.0.0.1"
            self.robots = enter(Robots(["tcp:127.0.0.1:0"] * robot_count, inside=there))
            files = [folder / f"robot-{index}.yaml" for index in range(robot_count)]
            for index, file in enumerate(files):
                text = robot_profile(index, "127.0.0.1", self.robots.ports[index])
                file.write_text(text, "utf-8")
            self._serve = partial(
                Server, files, folder / "data", *options, host=self.host, inside=(*there, *inside),
                module=self.module,
            )  # fmt: skip
            self.server = enter(self._serve())
            self.operators = enter(Operators(inside=here))
            self._witnesses = [enter(Robots([])) for _ in range(WITNESSES)]
            self._watch()
        except BaseException:
            self._programs.close()
            raise

    def _watch(self) -> None:
        """Measure how long pages, relay, server and guards wait for a processor."""
        path = [self.server, self.operators, *([self.relay] if self.relay else [])]
        self._watcher = self._programs.enter_context(Robots([f"pid:{one.pid}" for one in path]))

    def __enter__(self) -> Self:
        """Return self; all programs end when the `with` block ends."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End everything."""
        self._programs.close()

    def bout(self, death: str) -> list[Trial]:
        """Drive each robot from one page, and make all pages vanish; return the results."""
        began_ns = time.monotonic_ns()
        pages = self._begin(death)
        self._let_die(death, pages)
        heard = {index: self._await_stop(index, began_ns) for index in pages}
        self._heal(death, pages)
        for number in pages.values():
            self.operators.kill(number)
        return [
            self._judge(death, index, began_ns, heard[index], number)
            for index, number in pages.items()
        ]

    @property
    def indexes(self) -> range:
        """Indexes of all robots in the rig."""
        return range(len(self.robots.heard))

    def weather(self, *orders: str) -> None:
        """Send orders to the relay, such as orders to delay or drop packets."""
        self._link().do(*orders)

    def drive(
        self,
        index: int,
        death: str = "outside",
        drive_s: float = 0.0,
        *,
        has_spare: bool = False,
        key: str | None = None,
        cookie: str = "",
    ) -> int:
        """Make a page drive a robot until the page vanishes; return the page's number.

        Args:
            index: the robot's number.
            death: how the page vanishes, as in `bench.rig.operator_process.Plan`.
            drive_s: driving time before the page vanishes, in seconds.
            has_spare: whether the page has a second connection.
            key: the page's token; None for the start key.
            cookie: cookie from a sign-in, used instead of a token.
        """
        self._numbers += 1
        key = self.server.key if key is None else key
        plan = Plan(
            self._numbers, self.host, self.server.port, f"robot-{index}", death, drive_s,
            life_s=LIFE_S, key="" if cookie else key, cookie=cookie, has_spare=has_spare,
        )  # fmt: skip
        self.operators.start(plan._asdict())
        return self._numbers

    def _begin(self, death: str) -> Mapping[int, int]:
        how = "outside" if death in LINK_DEATHS else death
        return {
            index: self.drive(index, how, 0.3 + self._dice.random() * 0.2) for index in self.indexes
        }

    def _let_die(self, death: str, pages: Mapping[int, int]) -> None:
        for number in pages.values():
            self.operators.await_told("dying", number)
            if death == "black-hole":
                self._link().do(f"cut {self.operators.await_told('port', number)}")
        if death == "interface-down":
            self._link().do("down a")

    def _heal(self, death: str, pages: Mapping[int, int]) -> None:
        """Restore the link; the pages' queued data then arrives, but must not move a robot."""
        if death == "black-hole":
            self._link().do(*(f"heal {self.operators.news['port', one]}" for one in pages.values()))
        elif death == "interface-down":
            self._link().do("up a")
        if death in LINK_DEATHS:
            time.sleep(HEALED_S)

    def _link(self) -> Relay:
        if self.relay is None:
            raise ValueError("this rig was started without a relay")
        return self.relay

    def _await_stop(self, index: int, began_ns: int) -> int:
        """Wait until a robot has received motion, then a stop; return the number of its lines."""

        def is_still() -> bool:
            texts = [one.text for one in self.robots.since(index, began_ns)]
            return len(texts) > 1 and texts[-1] == "M 0"

        try:
            self.robots.wait_until(is_still, STOP_WITHIN_S, f"the stop of robot {index}")
        except AssertionError:
            return 0
        return len(self.robots.since(index, began_ns))

    def _judge(
        self,
        death: str,
        index: int,
        began_ns: int,
        until_stop: int,
        number: int,
        watcher: Robots | None = None,
    ) -> Trial:
        heard = self.robots.since(index, began_ns)
        moved = [place for place, one in enumerate(heard) if one.text != "M 0"]
        stop = next((one for one in heard[moved[-1] + 1 :] if one.text == "M 0"), None) if (
            moved
        ) else None  # fmt: skip
        if stop is None:
            said = self.operators.news["dying", number].partition(" ")[2]
            fault = "no stop came" if moved else f"nothing moved ({said})"
            return Trial(death, float("inf"), fault, 0.0, has_moved=bool(moved))
        sent_ns = int(heard[moved[-1]].text[2:]) * 1000
        fault = "" if moved[-1] < until_stop else "the robot moved again after the stop"
        late_ms = self.late_ms(sent_ns, stop.time_ns + 20_000_000, watcher)
        return Trial(death, (stop.time_ns - sent_ns) / 1e6, fault or _order(heard), late_ms)

    def late_ms(self, from_ns: int, until_ns: int, watcher: Robots | None = None) -> float:
        """Return the largest delay of the processes involved in a stop, in milliseconds.

        Args:
            from_ns: monotonic time at which the stop became due, in nanoseconds.
            until_ns: monotonic time at which the robot had received the stop, in nanoseconds.
            watcher: the watcher of the processes; by default the current server's watcher.
        """
        left_s = (until_ns + LOOK_NS - time.monotonic_ns()) / 1e9
        if left_s > 0:  # later, all waits until then are reported
            time.sleep(left_s)
        others = max(one.latest_ms(from_ns, until_ns) for one in self._witnesses)
        kept_ms = (watcher or self._watcher).waited_ms(from_ns, until_ns + LOOK_NS)
        return self.robots.latest_ms(from_ns, until_ns) + max(others, kept_ms)


def _order(heard: Sequence[Heard]) -> str:
    """Return a message if a value is older than an earlier received value, otherwise ""."""
    sent = [int(one.text[2:]) for one in heard if one.text != "M 0"]
    return "" if sent == sorted(sent) else "an older value arrived after a newer value"

"""Cuts of the link between server and robots while somebody drives, and what comes through after.

Each value of the motion is the time at which its tick was sent, so that the robot knows how old it
is when it arrives.
"""

import json
import random
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from urc.testing.rig import SERVER_ADDRESS, Heard, Operators, Relay, Robots, Server
from urc.testing.rig_deaths import lane_profile

__all__ = ["OLDEST_MS", "STOP_MS", "Cut", "CutRig"]

OLDEST_MS = 300.0
"""No motion that is older may reach a robot."""
STOP_MS = 100.0
"""The stop is to come within this time of the robot's being reachable."""
SHORT_S = 0.45
"""A cut that is shorter may pass unnoticed: nothing was late enough for a stop."""
LEAD_S = 0.2
WATCH_S = 1.0


class Cut(NamedTuple):
    """What one cut did to one robot."""

    lasted_s: float
    was_held: bool
    """Whether the control was held all the time, or let go during the cut."""
    oldest_ms: float
    """Age of the oldest motion that came after it; 0 when none came."""
    stop_ms: float
    """From the link's being back to the stop; infinite when none came."""
    fault: str
    late_ms: float

    @property
    def is_good(self) -> bool:
        """Whether the contract was kept."""
        has_stopped = self.stop_ms <= STOP_MS or (self.was_held and self.lasted_s < SHORT_S)
        return not self.fault and self.oldest_ms <= OLDEST_MS and has_stopped

    @property
    def is_excused(self) -> bool:
        """Whether this machine itself was later than the trial was: it says nothing then."""
        late = max(self.oldest_ms - OLDEST_MS, self.stop_ms - STOP_MS)
        return not self.fault and 0 < late <= self.late_ms


class CutRig:
    """Some robots behind a relay, and a server with pages on this side of it. Needs root."""

    def __init__(self, folder: Path, *, lanes: int = 6) -> None:
        """Start everything; the robots' documents and the server's data go into `folder`."""
        self._dice = random.Random(11)  # noqa: S311 - the same moments in every run
        self._numbers = 0
        self._programs = ExitStack()
        try:
            enter = self._programs.enter_context
            self.relay = enter(Relay())
            here, there = self.relay.inside("a"), self.relay.inside("b")
            self.robots = enter(Robots([f"tcp:{SERVER_ADDRESS}:0"] * lanes, inside=there))
            files = [folder / f"lane-{lane}.yaml" for lane in range(lanes)]
            for lane, file in enumerate(files):
                text = lane_profile(lane, SERVER_ADDRESS, self.robots.ports[lane])
                file.write_text(text, "utf-8")
            self.server = enter(Server(files, folder / "data", inside=here))
            self.operators = enter(Operators(inside=here))
        except BaseException:
            self._programs.close()
            raise

    def __enter__(self) -> Self:
        """Return it; everything ends with the block."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End everything."""
        self._programs.close()

    def cut(self, seconds: float, order: str = "cut") -> list[Cut]:
        """Cut the link while each robot is driven; return what came of it.

        Args:
            seconds: for how long.
            order: ``cut``, or ``cut a`` or ``cut b`` for one direction.
        """
        lanes = range(len(self.robots.heard))
        began_ns = time.monotonic_ns()
        pages = [self._drive(lane) for lane in lanes]
        for lane in lanes:
            self._await_motion(lane, began_ns)
        time.sleep(LEAD_S + self._dice.random() * 0.05)
        cut_ns = self.relay.do(order)
        before_s = seconds * (0.1 + self._dice.random() * 0.8)
        time.sleep(before_s)
        for lane in lanes:
            if lane % 2:
                self.operators.order(json.dumps({"let_go": pages[lane]}))
        time.sleep(seconds - before_s)
        healed_ns = self.relay.do(order.replace("cut", "heal"))
        time.sleep(WATCH_S)
        for number in pages:
            self.operators.kill(number)
        return [self._judge(lane, cut_ns, healed_ns, was_held=lane % 2 == 0) for lane in lanes]

    def _drive(self, lane: int) -> int:
        """Let a page drive a robot; return its number."""
        self._numbers += 1
        plan = {
            "number": self._numbers,
            "host": "127.0.0.1",
            "port": self.server.port,
            "robot": f"lane-{lane}",
            "death": "outside",
            "drive_s": 0.0,
        }
        self.operators.start(plan)
        return self._numbers

    def _await_motion(self, lane: int, began_ns: int) -> None:
        def moves() -> bool:
            return any(one.text != "M 0" for one in self.robots.since(lane, began_ns))

        self.robots.wait_until(moves, 10.0, f"motion of lane {lane}")

    def _judge(self, lane: int, cut_ns: int, healed_ns: int, *, was_held: bool) -> Cut:
        heard = [one for one in self.robots.since(lane, cut_ns) if one.time_ns > healed_ns]
        stops = [place for place, one in enumerate(heard) if one.text == "M 0"]
        motion = [one for one in heard if one.text != "M 0"]
        oldest_ms = max(
            ((one.time_ns - int(one.text[2:]) * 1000) / 1e6 for one in motion), default=0.0
        )
        # A stop may also have come before or within a cut of one direction.
        if not stops and self._had_stopped(lane, cut_ns, healed_ns):
            stop_ms = 0.0
        else:
            stop_ms = (heard[stops[0]].time_ns - healed_ns) / 1e6 if stops else float("inf")
        fault = ""
        if stops and any(one.text != "M 0" for one in heard[stops[0] :]):
            fault = "it moved again after the stop"
        elif stops and stops[0] and (healed_ns - cut_ns) / 1e9 >= SHORT_S:
            fault = "motion came before the stop"
        elif len(stops) > 2:  # one that lay in the kernel, and one on the new connection
            fault = f"{len(stops)} stops came"
        late_ms = self.robots.latest_ms(cut_ns, healed_ns + int(WATCH_S * 1e9))
        return Cut((healed_ns - cut_ns) / 1e9, was_held, oldest_ms, stop_ms, fault, late_ms)

    def _had_stopped(self, lane: int, cut_ns: int, healed_ns: int) -> bool:
        heard: Sequence[Heard] = self.robots.since(lane, cut_ns)
        within = [one for one in heard if one.time_ns <= healed_ns]
        return bool(within) and within[-1].text == "M 0"

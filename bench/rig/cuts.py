"""Cuts in the link between the server and the driven robots.

Each motion value is the send time of its tick, so the robot knows the age of received motion. One
rig has robots on every kind of transport. A cut affects the whole link or the link of a single
robot.
"""

import json
import random
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from threading import Lock
from types import TracebackType
from typing import NamedTuple, Self

from bench.rig.kinds import (
    FIRST_PORT,
    Bounds,
    bounds_of,
    document,
    place_of,
    start_counterpart,
)
from bench.rig.programs import Heard, Operators, Relay, Robots, Server

__all__ = ["LATE_MS", "Cut", "CutRig"]

LATE_MS = 300.0
"""Age beyond which motion counts as late, in milliseconds."""
BURST_MS = 100.0
"""Longest time from late motion to the stop, in milliseconds, if a transport allows late motion."""
LEAD_S = 0.2
WATCH_S = 1.0
READY_S = 25.0
ATTEMPTS = 3
"""Maximum number of attempts to start driving a robot."""


class NotDrivenError(AssertionError):
    """A page failed to move its robot; the rig tries up to `ATTEMPTS` times."""


class Cut(NamedTuple):
    """The result of one cut for one robot."""

    kind: str
    lasted_s: float
    was_held: bool
    """Whether the control was held throughout the cut; if False, it was released during the cut."""
    oldest_ms: float
    """Age of the oldest motion received after the cut, in milliseconds; 0 if there was no
    motion."""
    stop_ms: float
    """Time from the end of the cut to the stop, in milliseconds; infinite if there was no stop."""
    fault: str
    late_ms: float
    """Delay caused by the machine during the trial, in milliseconds."""
    was_moving: bool = True
    """Whether the robot was moving when the link was cut.

    On a busy machine, the robot may have stopped before the cut.
    """

    @property
    def bounds(self) -> Bounds:
        """Limits for this kind of transport."""
        return bounds_of(self.kind)

    @property
    def is_stop_needed(self) -> bool:
        """Whether the robot must receive a stop, as after a release or a long cut."""
        if not self.bounds.is_told:
            return False
        return not self.was_held or self.lasted_s >= self.bounds.unnoticed_s

    @property
    def is_good(self) -> bool:
        """Whether the robot moved in accordance with the motion contract."""
        is_stopped = self.stop_ms <= self.bounds.stop_ms or not self.is_stop_needed
        is_fresh = self.oldest_ms <= self.bounds.oldest_ms
        return self.was_moving and not self.fault and is_fresh and is_stopped

    @property
    def is_excused(self) -> bool:
        """Whether the machine's delay makes the trial invalid."""
        if not self.was_moving:
            return not self.fault
        late = self.oldest_ms - self.bounds.oldest_ms
        if self.is_stop_needed:
            late = max(late, self.stop_ms - self.bounds.stop_ms)
        return not self.fault and 0 < late <= self.late_ms


class CutRig:
    """A rig with robots on one side of a relay, and a server with pages on the other side.

    The rig needs root.
    """

    def __init__(self, folder: Path, kinds: Sequence[str]) -> None:
        """Start all programs; store the robots' documents and the server's data in `folder`.

        Args:
            folder: empty folder for documents and data.
            kinds: the kind of transport for each robot.
        """
        self.kinds = tuple(kinds)
        self._dice = random.Random(11)  # noqa: S311 - the same moments in every run
        self._numbers = 0
        self._lock = Lock()
        self._programs = ExitStack()
        try:
            self._start(folder)
        except BaseException:
            self._programs.close()
            raise

    def _start(self, folder: Path) -> None:
        enter = self._programs.enter_context
        self.relay = enter(Relay())
        here, there = self.relay.inside("a"), self.relay.inside("b")
        others = [
            start_counterpart(kind, index, folder, there) for index, kind in enumerate(self.kinds)
        ]
        for other in others:
            if other is not None:
                enter(other)
        places = [place_of(kind, index) for index, kind in enumerate(self.kinds)]
        self.robots = enter(Robots(places, inside=there))
        files = [folder / f"robot-{index}.yaml" for index in self.indexes]
        for index, (kind, file) in enumerate(zip(self.kinds, files, strict=True)):
            text = document(kind, index, self.robots.ports[index], others[index])
            file.write_text(text, "utf-8")
        self.server = enter(Server(files, folder / "data", inside=here))
        self.operators = enter(Operators(inside=here))
        self._witness = enter(Robots([]))
        path = [self.server, self.operators, self.relay]
        self._path = [one.pid for one in path]
        self._counterparts = [other.pid if other else 0 for other in others]
        watched = (*self._path, *filter(None, self._counterparts))
        self._watcher = enter(Robots([f"pid:{pid}" for pid in watched]))

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

    @property
    def indexes(self) -> range:
        """Indexes of all robots in the rig."""
        return range(len(self.kinds))

    def port(self, index: int) -> int:
        """Return the port that names the robot's link in an order to the relay."""
        first = FIRST_PORT.get(self.kinds[index])
        return self.robots.ports[index] if first is None else first + index

    def cut(self, seconds: float, order: str = "cut") -> list[Cut]:
        """Cut the link while each robot is driven; return the results.

        Args:
            seconds: duration of the cut.
            order: ``cut`` for both directions, ``cut a`` or ``cut b`` for one direction, or ``down
                a``.
        """
        return self._trial(self.indexes, seconds, order, self._share())

    def cut_one(self, index: int, seconds: float, share: float) -> Cut:
        """Cut one robot's link; several threads may call this method for different robots.

        Args:
            index: the robot's index in the rig.
            seconds: duration of the cut.
            share: share of the cut that passes before the control is released; every second cut has
                a release.
        """
        for _ in range(ATTEMPTS - 1):
            try:
                return self._trial((index,), seconds, f"cut {self.port(index)}", share)[0]
            except NotDrivenError:
                continue
        return self._trial((index,), seconds, f"cut {self.port(index)}", share)[0]

    def warm_up(self) -> None:
        """Drive each robot once, so that every guard has started and has loaded its transport."""
        for index in self.indexes:
            began_ns = time.monotonic_ns()
            number = self._drive(index)
            self._await_motion(index, began_ns)
            self.operators.kill(number)

    def drive_once(self, index: int, life_s: float) -> None:
        """Make a page drive a robot, then release the control.

        The page continues to run and stays in control.
        """
        began_ns = time.monotonic_ns()
        number = self._drive(index, life_s)
        self._await_motion(index, began_ns)
        self.operators.order(json.dumps({"let_go": number}))
        robots = self.robots
        robots.wait_until(
            lambda: robots.heard[index][-1].text == "M 0", READY_S, f"the stop of robot {index}"
        )

    def _share(self) -> float:
        return 0.1 + self._dice.random() * 0.8

    def _trial(self, indexes: Sequence[int], seconds: float, order: str, share: float) -> list[Cut]:
        began_ns = time.monotonic_ns()
        pages = {index: self._drive(index) for index in indexes}
        try:
            for index in indexes:
                self._await_motion(index, began_ns)
        except NotDrivenError:
            for number in pages.values():
                self.operators.kill(number)
            raise
        time.sleep(LEAD_S + share * 0.05)
        cut_ns = self.relay.do(order)
        time.sleep(seconds * share)
        released = {index: number for index, number in pages.items() if number % 2}
        for number in released.values():
            self.operators.order(json.dumps({"let_go": number}))
        time.sleep(seconds - seconds * share)
        healed_ns = self.relay.do(order.replace("cut", "heal").replace("down", "up"))
        self._watch(pages, released, cut_ns, healed_ns)
        cuts = [
            self._judge(index, cut_ns, healed_ns, was_held=index not in released)
            for index in indexes
        ]
        for number in pages.values():
            self.operators.kill(number)
        return cuts

    def _drive(self, index: int, life_s: float = 120.0) -> int:
        """Make a page drive a robot; return the page's number."""
        with self._lock:
            self._numbers += 1
            number = self._numbers
        plan = {
            "number": number,
            "host": "127.0.0.1",
            "port": self.server.port,
            "key": self.server.key,
            "robot": f"robot-{index}",
            "death": "outside",
            "drive_s": 0.0,
            "life_s": life_s,
        }
        self.operators.start(plan)
        return number

    def _await_motion(self, index: int, began_ns: int) -> None:
        def moves() -> bool:
            return any(one.text != "M 0" for one in self.robots.since(index, began_ns))

        what = f"motion of robot {index} ({self.kinds[index]})"
        try:
            self.robots.wait_until(moves, READY_S, what)
        except AssertionError as error:
            raise NotDrivenError(str(error)) from error

    def _watch(
        self, pages: Sequence[int] | dict[int, int], released: dict[int, int],
        cut_ns: int, healed_ns: int,
    ) -> None:  # fmt: skip
        """Wait for the required stops, then watch for motion that must not happen."""
        for index in pages:
            bounds = bounds_of(self.kinds[index])
            is_short = (healed_ns - cut_ns) / 1e9 < bounds.unnoticed_s
            if not bounds.is_told or (is_short and index not in released):
                continue
            left_s = bounds.stop_ms / 1000 - (time.monotonic_ns() - healed_ns) / 1e9
            try:
                self.robots.wait_until(
                    lambda index=index: self._stops(index, cut_ns),  # type: ignore[misc]
                    max(left_s, 0.01),
                    "a stop",
                )
            except AssertionError:
                continue  # checked later
        time.sleep(WATCH_S)

    def _stops(self, index: int, cut_ns: int) -> bool:
        return any(one.text == "M 0" for one in self.robots.since(index, cut_ns))

    def _judge(self, index: int, cut_ns: int, healed_ns: int, *, was_held: bool) -> Cut:
        kind, all_heard = self.kinds[index], self.robots.since(index, cut_ns)
        heard = [one for one in all_heard if one.time_ns > healed_ns]
        stops = [place for place, one in enumerate(heard) if one.text == "M 0"]
        ages_ms = [
            (one.time_ns - int(one.text[2:]) * 1000) / 1e6 for one in heard if one.text != "M 0"
        ]
        # After a cut in one direction, the stop may also have arrived before the end of the cut.
        before = [one for one in all_heard if one.time_ns <= healed_ns]
        if not stops and before and before[-1].text == "M 0":
            stop_ms = 0.0
        else:
            stop_ms = (heard[stops[0]].time_ns - healed_ns) / 1e6 if stops else float("inf")
        lasted_s = (healed_ns - cut_ns) / 1e9
        is_noticed = lasted_s >= bounds_of(kind).unnoticed_s
        now_ns = time.monotonic_ns()
        witness_ms = self._witness.latest_ms(cut_ns, now_ns)
        stop_ns = heard[stops[0]].time_ns if stops else now_ns
        path = (*self._path, self._counterparts[index])
        waited_ms = self._watcher.waited_ms(healed_ns, stop_ns, path)
        late_ms = self.robots.latest_ms(cut_ns, now_ns) + max(witness_ms, waited_ms)
        fault = _fault(
            bounds_of(kind), heard, [age - late_ms for age in ages_ms],
            is_noticed=is_noticed, was_held=was_held, burst_ms=BURST_MS + late_ms,
        )  # fmt: skip
        oldest_ms = max(ages_ms, default=0.0)
        earlier = [one.text for one in self.robots.heard[index] if one.time_ns < cut_ns]
        was_moving = earlier[-1:] != ["M 0"]
        return Cut(kind, lasted_s, was_held, oldest_ms, stop_ms, fault, late_ms, was_moving)


def _fault(
    bounds: Bounds,
    heard: Sequence[Heard],
    ages_ms: Sequence[float],
    *,
    is_noticed: bool,
    was_held: bool,
    burst_ms: float,
) -> str:
    """Return a description of the violation of the motion contract after a cut, or ""."""
    texts = [one.text for one in heard]
    moved = [text for text in texts if text != "M 0"]
    stop = texts.index("M 0") if "M 0" in texts else len(texts)
    late = sum(age > LATE_MS for age in ages_ms)
    if any(text != "M 0" for text in texts[stop:]):
        return "the robot moved again after its stop"
    if len(moved) != len(set(moved)):
        return "the same motion value arrived twice"
    if bounds.most_late is not None and late > bounds.most_late:
        return f"{late} late motion values arrived"
    if not bounds.is_repeated and len(texts) - stop > 2:
        return f"{len(texts) - stop} stops came"  # one may be in the kernel, one on the new link
    if not was_held and len(moved) > (bounds.most_late or 0):
        return "motion arrived after the control's release" if is_noticed else ""
    if is_noticed and bounds.is_told and stop > (bounds.most_late or 0):
        return "motion arrived before the stop"
    is_last = late == stop < len(texts)  # no fresh motion in between
    if late and is_last and heard[stop].time_ns - heard[0].time_ns > burst_ms * 1e6:
        return "the stop arrived long after late motion"
    return ""

"""Trials in which a driven robot's program freezes for a few seconds.

The robot's program is separate (`bench.rig.robot_process`). SIGSTOP and SIGCONT suspend
and resume this program, while the kernel still accepts bytes for it. A session with a guard drives
the robot. Each motion frame contains its send time, and the robot's program timestamps each
received line.
"""

import asyncio
import os
import random
import signal
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from math import inf
from pathlib import Path
from typing import Final, NamedTuple

from bench.rig.programs import Robots
from urc.config.load import load_profile
from urc.model.profile import Profile
from urc.motion.hold_to_run import HoldTerms
from urc.problems import UrcError
from urc.runtime.held_commands import is_lossy, restored_s
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session

__all__ = ["HEARD_MS", "STOP_MS", "Freeze", "freeze"]

HEARD_MS: Final = 500.0
"""Latest allowed send time of motion that still arrives, in milliseconds after the freeze
begins."""
STOP_MS: Final = 200.0
"""Longest allowed time from the end of the freeze to the stop, in milliseconds."""
REVIVED_MS: Final = 1000.0
"""Longest allowed time from a new program's start to the stop, in milliseconds; same limit as
in `bench.rig.kinds` for slow transports."""
_TICK_S: Final = 0.05
_AFTERWARDS_S: Final = 1.2
_READY_S: Final = 10.0
_ROS: Final = "type: ros, via: VIA, version: 2"
_ROS_SEND: Final = '{ topic: /go, type: std_msgs/Int64, json: { data: "{{ t }}" } }'
_WAYS: Final = {
    "rosbridge": ("bridge", _ROS.replace("VIA", "rosbridge"), _ROS_SEND),
    "foxglove": ("foxglove", _ROS.replace("VIA", "foxglove"), _ROS_SEND),
    "zenoh": ("zenoh", "type: zenoh", '{ topic: go, text: "M {{ t }}" }'),
    "ros_zenoh": ("zenoh", _ROS.replace("VIA", "zenoh"), _ROS_SEND),
}
"""Address, transport and motion frame, for each kind of server."""
_THROTTLED: Final = {"a": "100ms", "b": "200ms", "c": "500ms", "d": "1s", "e": "2s"}
"""Throttle of each topic that the robot publishes at 50 Hz, where URC itself throttles."""
_THROTTLES: Final = ("foxglove", "ros_zenoh")
_DOCUMENT: Final = """\
urc: 1
kind: robot
name: frozen
transports:
  wire: { TRANSPORT, host: 127.0.0.1, port: PORT, reconnect: { initial: 100ms } }
commands:
  go:
    send: { publish: SEND }
    args: { t: { type: integer, min: 0, default: 0 } }
    hold: { repeat: 50ms, release: { t: 0 }, watchdog: none }
"""


class Freeze(NamedTuple):
    """The result of one freeze."""

    lasted_s: float
    newest_ms: float
    """Send time of the newest received motion, in milliseconds after the start of the freeze."""
    stop_ms: float
    """Time from the end of the freeze to the stop, in milliseconds; `inf` if there was no stop."""
    is_last: bool
    """Whether the stop was the last line that arrived."""
    late_ms: float
    """Delay caused by the machine during the trial, in milliseconds."""
    was_moving: bool = True
    """Whether the robot was moving at the start of the freeze.

    On a slow machine, an expired lease may have stopped the robot already.
    """
    limit_ms: float = STOP_MS
    """Longest allowed `stop_ms`."""

    @property
    def is_good(self) -> bool:
        """Whether the trial met all limits."""
        return self.newest_ms <= HEARD_MS and self.stop_ms <= self.limit_ms and self.is_last

    @property
    def is_excused(self) -> bool:
        """Whether the trial is invalid: the machine was too slow, or the robot was at rest."""
        is_late = not self.is_good and self.is_last and self.late_ms > STOP_MS / 2
        return is_late or not self.was_moving


async def freeze(
    rounds: int,
    *,
    robot_count: int = 1,
    lasts_s: float = 5.0,
    seed: int = 1,
    via: str = "rosbridge",
    is_killed: bool = False,
    told: Callable[[Freeze], None] | None = None,
) -> Sequence[Freeze]:
    """Freeze each of `robot_count` robots `rounds` times, for `lasts_s` seconds each.

    If `via` is rosbridge, the robot's program is a substitute for rosbridge. If `via` is foxglove,
    the program is the SDK's server. If `via` is zenoh or ros_zenoh, the program is a Zenoh router.
    With foxglove and ros_zenoh, the robot also publishes topics that URC throttles. With
    `is_killed`, the program is killed instead, and a new program starts `lasts_s` seconds later.
    """
    dice = random.Random(seed)  # noqa: S311 - the same moments in every run
    moments = [[0.4 + dice.random() for _ in range(rounds)] for _ in range(robot_count)]
    done: list[Freeze] = []

    def take(one: Freeze) -> None:
        done.append(one)
        if told is not None:
            told(one)

    async with asyncio.TaskGroup() as group:
        for each in moments:
            group.create_task(_queue(each, lasts_s, via, is_killed, take))
    return done


async def _queue(
    moments: Sequence[float],
    lasts_s: float,
    via: str,
    is_killed: bool,
    told: Callable[[Freeze], None],
) -> None:
    door = _WAYS[via][0]
    robots = await asyncio.to_thread(Robots, [f"{door}:127.0.0.1:0"])
    port = robots.ports[0]
    try:
        transports = built_in_catalog().transports
        async with Session(_profile(port, via), {}, transports, motion="guarded") as session:
            for moment_s in moments:
                if not is_killed:
                    told(await _one(session, robots, moment_s, _Pause(robots, lasts_s)))
                    continue
                death = _Death(robots, lasts_s, f"{door}:127.0.0.1:{port}")
                told(await _one(session, robots, moment_s, death))
                robots = death.robots
    finally:
        with suppress(ProcessLookupError):
            os.kill(robots.pid, signal.SIGCONT)
        await asyncio.to_thread(robots.close)


class _Pause:
    """Freezes the robot's program."""

    limit_ms = STOP_MS

    def __init__(self, robots: Robots, lasts_s: float) -> None:
        self.robots, self._lasts_s = robots, lasts_s

    async def __call__(self) -> tuple[int, int]:
        """Return the start and end times of the freeze, in nanoseconds."""
        self.robots.signal(signal.SIGSTOP)
        frozen_ns = time.monotonic_ns()
        await asyncio.sleep(self._lasts_s)
        thawed_ns = time.monotonic_ns()
        self.robots.signal(signal.SIGCONT)
        return frozen_ns, thawed_ns


class _Death:
    """Kills the robot's program, and starts a new program on the same port."""

    limit_ms = REVIVED_MS

    def __init__(self, robots: Robots, lasts_s: float, place: str) -> None:
        self.robots, self._lasts_s, self._place = robots, lasts_s, place

    async def __call__(self) -> tuple[int, int]:
        """Return the times of the kill and of the restart, in nanoseconds."""
        self.robots.signal(signal.SIGKILL)
        killed_ns = time.monotonic_ns()
        await asyncio.to_thread(self.robots.close)
        await asyncio.sleep(self._lasts_s)
        self.robots = await asyncio.to_thread(Robots, [self._place])
        return killed_ns, time.monotonic_ns()


def _profile(port: int, via: str) -> Profile:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "frozen.yaml")
        _, transport, send = _WAYS[via]
        text = _DOCUMENT.replace("TRANSPORT", transport).replace("SEND", send)
        if via in _THROTTLES:
            text += _throttled()
        file.write_text(text.replace("PORT", str(port)), "utf-8")
        return load_profile(file, built_in_catalog())


def _throttled() -> str:
    """Return the signals and messages of the topics that URC throttles."""
    signals = [f"  {name}: {{}}\n" for name in _THROTTLED]
    wish = "topic: /{0}, type: std_msgs/Int64, throttle: {1}"
    messages = [
        f"  {name}: {{ subscribe: {{ {wish.format(name, wait)} }}, json: {{ {name}: data }} }}\n"
        for name, wait in _THROTTLED.items()
    ]
    return "".join(["signals:\n", *signals, "messages:\n", *messages])


async def _one(
    session: Session, robots: Robots, moment_s: float, trouble: _Pause | _Death
) -> Freeze:
    """Drive a robot, freeze or kill its program, and check the received data."""
    backend = session.backend
    assert backend is not None
    ends_s = time.monotonic() + _READY_S
    while not (backend.is_open("go") and session.frames.is_ready("go")):
        if time.monotonic() > ends_s:
            return Freeze(0.0, inf, inf, is_last=False, late_ms=0.0)
        await asyncio.sleep(0.02)
    await asyncio.sleep(_AFTERWARDS_S)
    stop, lossy = session.frames.stop_frame("go"), is_lossy(session.profile.driver, "wire")
    late_s = restored_s(session.profile.driver, "wire")
    terms = HoldTerms(b"", period_s=_TICK_S, is_lossy=lossy, restored_s=late_s)
    backend.arm("go", terms.stopped_by(stop))
    holding = asyncio.create_task(_hold(session))
    try:
        await asyncio.sleep(moment_s)
        frozen_ns, thawed_ns = await trouble()
        await asyncio.sleep(_AFTERWARDS_S)
    finally:
        holding.cancel()
    before = [one for one in robots.since(0, 0) if one.time_ns < frozen_ns]
    was_moving = bool(before) and before[-1].text != "M 0"
    return _judged(trouble.robots, frozen_ns, thawed_ns, was_moving, trouble.limit_ms)


async def _hold(session: Session) -> None:
    """Send ticks until cancelled, like an operator who does not notice the freeze."""
    assert session.backend is not None
    while True:
        now_ns = time.monotonic_ns()
        with suppress(UrcError):  # the connection is closed, but the operator continues
            session.backend.tick(
                "go", session.frames.motion_frame("go", {"t": now_ns // 1000}, 0.0)
            )
        await asyncio.sleep(_TICK_S)


def _judged(
    robots: Robots, frozen_ns: int, thawed_ns: int, was_moving: bool, limit_ms: float
) -> Freeze:
    heard = [(one.time_ns, int(one.text.split()[1])) for one in robots.since(0, frozen_ns)]
    sent_ns = [sent_us * 1000 for _, sent_us in heard if sent_us]
    stops = [at_ns for at_ns, sent_us in heard if not sent_us and at_ns >= thawed_ns]
    late = [ms for at_ns, ms in robots.late if at_ns > thawed_ns + 50_000_000]
    return Freeze(
        lasted_s=(thawed_ns - frozen_ns) / 1e9,
        newest_ms=(max(sent_ns, default=frozen_ns) - frozen_ns) / 1e6,
        stop_ms=(stops[0] - thawed_ns) / 1e6 if stops else inf,
        is_last=bool(heard) and not heard[-1][1],
        late_ms=max(late, default=0.0),
        was_moving=bool(sent_ns) or was_moving,
        limit_ms=limit_ms,
    )

"""Robots driven over UDP, whose motion and polls share one frame counter.

Each robot is a socket that stores received frames in order and answers polls. A session with a
guard drives the robots. Each gesture uses a separate connection. A control is held for several
seconds, sometimes together with a second control. A gesture ends when all held controls are
released, or when the leases expire.
"""

import asyncio
import random
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple, cast

from urc.config.load import load_profile
from urc.model.profile import Profile
from urc.motion.freshness import ControlInput
from urc.motion.lease import Operator
from urc.problems import UrcError
from urc.runtime.motion_controller import MotionController
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session

__all__ = ["NUMBERS", "Gesture", "gestures"]

NUMBERS: Final = 65536
_TICK_S: Final = 0.05
_SETTLED_S: Final = 1.0
_READY_S: Final = 30.0
_DOCUMENT: Final = """\
urc: 1
kind: robot
name: counted
signals: { volts: { type: integer } }
transports:
  wire:
    type: udp
    host: 127.0.0.1
    port: PORT
    framing: { type: datagram }
    stale_after: 5s
    keepalive: { send: "{{ seq('n', 0, 65535) }} ALIVE", every: 330ms }
commands:
  drive:
    send: "{{ seq('n', 0, 65535) }} DRIVE {{ v }}"
    args: { v: { type: integer, min: -99, max: 99, default: 0 } }
    hold: { repeat: 20ms, release: {}, watchdog: none }
  lift:
    send: "{{ seq('n', 0, 65535) }} LIFT {{ v }}"
    args: { v: { type: integer, min: -99, max: 99, default: 0 } }
    hold: { repeat: 50ms, release: {}, watchdog: none }
polls:
  - send: "{{ seq('n', 0, 65535) }} VOLTS"
    every: 35ms
    reply: { regex: '^(?P<_n>\\d+) V (?P<volts>\\d+)$', match: _n == seq.n }
"""


class Gesture(NamedTuple):
    """Frames that the robot received during one gesture."""

    lasted_s: float
    frames: int
    motions: int
    fault: str
    """Description of the first error in the frames, or ""."""


class _Robot(asyncio.DatagramProtocol):
    def __init__(self) -> None:
        self.heard: list[tuple[int, int, str]] = []
        """Source port (different for each connection), counter and text of each frame."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast("asyncio.DatagramTransport", transport)

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        number, _, words = data.decode().partition(" ")
        self.heard.append((addr[1], int(number), words))
        if words == "VOLTS":
            self._transport.sendto(f"{number} V 12".encode(), addr)


async def gestures(
    lasts_s: Sequence[float],
    *,
    robot_count: int,
    seed: int = 1,
    told: Callable[[Gesture], None] | None = None,
) -> Sequence[Gesture]:
    """Run one gesture for each duration, with `robot_count` robots in parallel."""
    dice = random.Random(seed)  # noqa: S311 - the same gestures in every run
    left, done = list(lasts_s), list[Gesture]()

    async def work() -> None:
        while left:
            gesture = await _one(left.pop(), dice)
            done.append(gesture)
            if told is not None:
                told(gesture)

    async with asyncio.TaskGroup() as group:
        for _ in range(robot_count):
            group.create_task(work())
    return done


async def _one(lasts_s: float, dice: random.Random) -> Gesture:
    loop = asyncio.get_running_loop()
    transport, robot = await loop.create_datagram_endpoint(_Robot, local_addr=("127.0.0.1", 0))
    try:
        profile = _profile(transport.get_extra_info("sockname")[1])
        transports = built_in_catalog().transports
        async with Session(profile, {}, transports, motion="guarded") as session:
            fault = await _drive(session, lasts_s, dice)
            await asyncio.sleep(_SETTLED_S)
            heard = list(robot.heard)
    finally:
        transport.close()
    return _judged(lasts_s, heard, fault)


def _profile(port: int) -> Profile:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "counted.yaml")
        file.write_text(_DOCUMENT.replace("PORT", str(port)), "utf-8")
        return load_profile(file, built_in_catalog())


async def _drive(session: Session, lasts_s: float, dice: random.Random) -> str:
    """Hold one control throughout and another at times; then release both, or stop all ticks."""
    controller, loop = MotionController(session.profile.driver), asyncio.get_running_loop()
    controller.join(Operator("hand", "hand", "drive"))
    controller.attach(session)
    ready_s = loop.time() + _READY_S
    while not session.frames.is_ready("drive"):
        if loop.time() > ready_s:
            return "the connection was never ready"
        await asyncio.sleep(0.02)
    controller.drive("hand", "take", loop.time())
    ends_s, ticks = loop.time() + lasts_s, 0
    following = asyncio.create_task(_follow(session, controller))
    while loop.time() < ends_s:
        refused = ""
        for command in ("drive", "lift") if ticks % 60 > 30 else ("drive",):
            ticks, now = ticks + 1, loop.time()
            given = ControlInput(
                controller.lease.state.epoch, ticks, controller.heartbeat("hand", now)
            )
            with suppress(UrcError):
                value = {"v": dice.randrange(1, 99)}
                refused = refused or controller.tick("hand", command, value, given, now)
        if ticks % 60 == 0:
            controller.release("hand", "lift")
        if refused:  # the machine was too slow for the lease: release, and start a new gesture
            controller.release("hand", "drive")
            controller.release("hand", "lift")
            controller.drive("hand", "leave", loop.time())
            controller.drive("hand", "take", loop.time())
        await asyncio.sleep(_TICK_S * dice.uniform(0.5, 1.2))
    if dice.random() < 0.5:
        controller.release("hand", "drive")
        controller.release("hand", "lift")
    await asyncio.sleep(_SETTLED_S)
    following.cancel()
    controller.detach()
    return ""


async def _follow(session: Session, controller: MotionController) -> None:
    """Tell the motion controller about every stop that the guard has sent, until cancelled."""
    assert session.backend is not None
    while True:
        for command, reason in await session.backend.stops():
            controller.stopped(command, reason)


def _judged(lasts_s: float, heard: Sequence[tuple[int, int, str]], fault: str) -> Gesture:
    """Return the gesture, with the first error in its frames."""
    motions = [words for _, _, words in heard if words.startswith(("DRIVE", "LIFT"))]
    places: dict[int, int] = {}
    for port, number, words in heard:
        place = places[port] = places.get(port, -1) + 1  # each connection starts at 0
        if number != place % NUMBERS and not fault:
            fault = f"{number} {words} instead of {place % NUMBERS}"
    last = {words.split()[0]: words for words in motions}
    moving = [words for words in last.values() if not words.endswith(" 0")]
    fault = fault or (f"nothing stops {moving[0]}" if moving else "")
    if len(motions) < lasts_s:
        fault = fault or f"received only {len(motions)} frames of motion"
    return Gesture(lasts_s, len(heard), len(motions), fault)

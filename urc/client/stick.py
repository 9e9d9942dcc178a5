"""A program's stick: sampled input for one held command, under the motion contract.

Layer 5. Theory of operation. Calling the stick sets the input and its time. A sampler sends a tick
for new input, and at least every 50 ms, while the input is younger than `valid_s`. A program that
hangs, sleeps too long, raises an exception or dies does not renew its input, so the robot stops. No
timer sends ticks for a program that does not renew its input.

If motion ends for any reason except `release` or the end of the context, further calls to the stick
fail. New motion then requires a new context, just as a person must release and press a control
again.
"""

import asyncio
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Final, Protocol

from urc.model.values import Reading
from urc.problems import UrcError

__all__ = [
    "TICK_S",
    "VALID_S",
    "MotionEnded",
    "MotionLine",
    "Stick",
    "checked_validity",
    "sample_stick",
]

VALID_S: Final = 0.25
"""Default time for which one call to the stick moves the robot, in seconds."""
SHORTEST_VALID_S: Final = 0.05
LONGEST_VALID_S: Final = 1.0
TICK_S: Final = 0.05
"""Interval between two ticks with unchanged input, in seconds."""
_SOONEST_S: Final = 0.01
"""Shortest interval between two ticks, in seconds; later input waits for its tick."""
HELD_UP_S: Final = 0.25
"""Sampling gap after which motion ends, in seconds; a gap means a suspended or blocked process."""


class MotionEnded(UrcError):
    """Motion ended before its context: after a stop, a refusal, a lost connection or late input."""


class MotionLine(Protocol):
    """Sends the ticks of sticks to the robot; each opening has its own implementation."""

    def tick(self, command: str, arguments: Mapping[str, Reading]) -> str:
        """Send one tick; return the reason why motion must end, or "" if motion may continue."""

    def release(self, command: str) -> None:
        """Stop the command, because its stick was released."""


class Stick:
    """The input of one held command, valid while the `drive` context is open.

    ``stick(speed=0.5)`` moves the robot for at most `valid_s` seconds; call the stick again before
    that time ends. Calls are cheap and may come from any thread.
    """

    def __init__(self, command: str, valid_s: float = VALID_S) -> None:
        """Create a stick without input; programs call `drive` instead of using this constructor."""
        self.command = command
        """Name of the held command."""
        self.valid_s = valid_s
        self.ended = ""
        """Reason why motion ended; "" while the stick can move the robot."""
        self._input: tuple[Mapping[str, Reading], float] | None = None
        self._moved_s: float | None = None
        """Time of the last sample in seconds, if the stick had input then; otherwise None."""
        self._changed = asyncio.Event()

    def __call__(self, /, **arguments: Reading) -> None:
        """Set the held command's arguments; missing arguments use their defaults.

        Raises:
            MotionEnded: motion has ended; the message states the reason.
        """
        self.put(arguments)
        self.wake()

    async def hold(self, seconds: float, /, **arguments: Reading) -> None:
        """Keep the same arguments for the given time, while this call is awaited.

        Args:
            seconds: the duration; the robot then continues to move for `valid_s` seconds, unless
                the stick is called or released.
            arguments: as in a call to the stick.

        Raises:
            MotionEnded: motion ended before the time had passed.
        """
        ends_s = time.monotonic() + seconds
        while (left_s := ends_s - time.monotonic()) > 0:
            self(**arguments)
            await asyncio.sleep(min(TICK_S, left_s))
        if self.ended:
            raise MotionEnded(self.ended)

    def release(self) -> None:
        """Stop the robot and keep the controls; the next call to the stick moves the robot again.

        Raises:
            MotionEnded: motion has already ended.
        """
        if self.ended:
            raise MotionEnded(self.ended)
        self.clear()
        self.wake()

    # -- the owner of the context

    def put(self, arguments: Mapping[str, Reading]) -> None:
        """Set the input, from any thread, without waking the sampler."""
        if self.ended:
            raise MotionEnded(self.ended)
        self._input = (dict(arguments), time.monotonic())

    def clear(self) -> None:
        """Remove the input, from any thread, without waking the sampler."""
        self._input = None

    def wake(self) -> None:
        """Make the sampler read the input now; call this method on the event loop."""
        self._changed.set()

    def end(self, reason: str) -> None:
        """End all motion of this stick; after several calls, the first reason remains."""
        self.ended = self.ended or reason
        self._input = None
        self.wake()

    def expire(self, reason: str, now_s: float) -> None:
        """End all motion because the guard received no input in time.

        If this program was blocked, the guard's report may be handled before the sampler runs.
        Motion has then ended because the program was blocked.

        Args:
            reason: the reason if this program was not blocked.
            now_s: time on the sampler's clock, in seconds.
        """
        self.end(self.block_since_sample(now_s) or reason)

    def block_since_sample(self, now_s: float) -> str:
        """Return the reason to end motion after a long sampling gap; "" for a short gap."""
        if self._moved_s is None or now_s - self._moved_s <= HELD_UP_S:
            return ""
        return f"this program was blocked for {(now_s - self._moved_s) * 1000:.0f} ms"

    def sampled(self, now_s: float, *, is_moving: bool) -> None:
        """Record a sample's time during motion; without motion, a blocked program does no harm."""
        self._moved_s = now_s if is_moving else None

    def sample(self) -> tuple[Mapping[str, Reading], float] | None:
        """Return the last call's arguments and time; None if there is no input."""
        self._changed.clear()
        return self._input

    async def changed(self, timeout_s: float) -> None:
        """Wait for new input since the last `sample`, for at most `timeout_s` seconds."""
        with suppress(TimeoutError):
            async with asyncio.timeout(timeout_s):
                await self._changed.wait()


async def sample_stick(
    stick: Stick, line: MotionLine, now: Callable[[], float] = time.monotonic
) -> None:
    """Send the input of `stick` as ticks until the stick ends or this task is cancelled."""
    is_moving = False
    while not stick.ended:
        at_s = now()
        if blocked := stick.block_since_sample(at_s):
            stick.end(blocked)
            break
        given = stick.sample()
        stick.sampled(at_s, is_moving=given is not None)
        if given is None:
            if is_moving:
                line.release(stick.command)
            is_moving = False
            await stick.changed(TICK_S)
            continue
        arguments, given_s = given
        if at_s - given_s >= stick.valid_s:
            stick.end(_late(stick))
            break
        is_moving = True
        if reason := line.tick(stick.command, arguments):
            stick.end(reason)
            break
        await asyncio.sleep(_SOONEST_S)
        due_s = min(at_s + TICK_S, given_s + stick.valid_s)
        await stick.changed(max(0.0, due_s - now()))
    line.release(stick.command)


def _late(stick: Stick) -> str:
    return (
        f"the stick was not called for {stick.valid_s * 1000:.0f} ms: call it more often, or"
        " await stick.hold(SECONDS, …)"
    )


def checked_validity(valid_s: float) -> float:
    """Return `valid_s`; raise `UrcError` if the time is outside its range."""
    if not SHORTEST_VALID_S <= valid_s <= LONGEST_VALID_S:
        raise UrcError(
            f"valid_s: expected {SHORTEST_VALID_S:g} to {LONGEST_VALID_S:g} seconds,"
            f" found {valid_s:g}"
        )
    return valid_s

"""A fake motion backend, which records each written frame as readable text, with its time."""

import asyncio
from collections.abc import Callable, Mapping, Sequence
from math import inf

from urc.model.driver import Driver
from urc.model.payload import CountedFrame, FrameVariants, Payload
from urc.model.values import Reading
from urc.motion.hold_to_run import HoldTerms, HoldToRun, Reason, StopReport
from urc.problems import UrcError
from urc.protocol.events import MotionEvent, NumbersUsed
from urc.protocol.requests.encode import check_arguments
from urc.runtime.clock import Clock, Timer
from urc.runtime.held_commands import MotionBackend

__all__ = ["FakeFrames", "FakeMotionBackend", "FakeSession"]


class FakeFrames:
    """An encoder whose frames are text, such as ``drive speed=0.5 turn=0`` and ``drive stop``."""

    def __init__(self, driver: Driver) -> None:
        self.driver = driver
        self.refusal = ""
        """Message with which every motion frame is refused; "" accepts all frames."""
        self.on_motion: Callable[[MotionEvent], None] | None = None
        """Callback for the engine's motion events."""
        self.is_greeted = True
        """Whether all connection steps have run."""
        self.number = 0
        """Counter of the newest frame; 0 for frames without a counter."""

    def is_lasting(self, command: str) -> bool:
        """Return whether the stop frame of the command never changes."""
        self._known(command)
        return not self.number

    def has_stops(self, command: str) -> bool:
        """Return False, because rendered stop frames are never reused."""
        return False

    def is_ready(self, command: str) -> bool:
        """Return whether the command's transport is ready."""
        self._known(command)
        return self.is_greeted

    def _known(self, command: str) -> None:
        if command not in self.driver.commands:
            raise KeyError(command)

    def send(self, line: str = "wire") -> int:
        """Increment the counter for another frame and return its new value."""
        self.number = number = self.number + 1
        self.tell(NumbersUsed(line))
        return number

    def tell(self, event: MotionEvent) -> None:
        """Report an event from the engine."""
        if self.on_motion is not None:
            self.on_motion(event)

    def _numbered(self) -> str:
        return f"{self.number + 1} " if self.number else ""

    def stop_frame(self, command: str) -> Payload:
        """Return the stop frame of a command, without advancing the counter."""
        return f"{self._numbered()}{command} stop".encode()

    def motion_frame(self, command: str, arguments: Mapping[str, Reading], now: float) -> Payload:
        """Return the motion frame with the command's arguments, after the engine's checks."""
        if self.refusal:
            raise UrcError(self.refusal)
        values = check_arguments(self.driver.commands[command], arguments)
        text = " ".join((command, *(f"{name}={value!r}" for name, value in values.items())))
        data = f"{self._numbered()}{text}".encode()
        if self.number:
            self.number += 1
        return data


class FakeSession:
    """The part of a session that the motion controller uses."""

    def __init__(self, frames: FakeFrames, backend: MotionBackend | None) -> None:
        self.frames = frames
        self.backend = backend

    @property
    def on_motion(self) -> Callable[[MotionEvent], None] | None:
        """Callback for the engine's motion events."""
        return self.frames.on_motion

    @on_motion.setter
    def on_motion(self, take: Callable[[MotionEvent], None] | None) -> None:
        self.frames.on_motion = take


class FakeMotionBackend:
    """Real hold-to-run state machines; their fake transport accepts data while `is_up` is true."""

    def __init__(self, clock: Clock, write: Callable[[bytes], None] | None = None) -> None:
        self.written: list[tuple[float, str]] = []
        """Time and text of each write; writes to a closed transport are not recorded."""
        self.reasons: list[Reason] = []
        """Reasons for all stops, in order."""
        self.ticked_s = float("-inf")
        """Time of the last accepted tick, in seconds."""
        self.is_up = True
        self._clock = clock
        self._write = write
        self._backend: dict[str, HoldToRun] = {}
        self._alarm: Timer | None = None
        self._stops: asyncio.Queue[tuple[str, StopReport]] = asyncio.Queue()

    @property
    def texts(self) -> list[str]:
        """Return the texts of all written frames."""
        return [text for _, text in self.written]

    def arm(self, command: str, terms: HoldTerms) -> None:
        """Accept ticks of the command from now on."""
        hold_to_run = self._backend.get(command)
        if hold_to_run is None or hold_to_run.state == "idle":
            hold_to_run = self._backend[command] = HoldToRun(terms)
        hold_to_run.arm()

    def is_armed(self, command: str) -> bool:
        """Return whether ticks of the command are accepted."""
        return command in self._backend and self._backend[command].is_armed

    def tick(self, command: str, data: Payload | CountedFrame, for_s: float = inf) -> None:
        """Renew the lease, for at most `for_s` seconds."""
        assert not isinstance(data, CountedFrame)  # noqa: S101 - the fake has no shared counters
        now = self._clock.now()
        if self._backend[command].tick(data or None, now, now + for_s):
            self.ticked_s = now
        self.write_due()

    def renew(self, command: str, stop: Payload | FrameVariants) -> None:
        """Replace the stop frame of the command."""
        hold_to_run = self._backend[command]
        hold_to_run.renew(hold_to_run.terms.stopped_by(stop))

    def is_stopping(self, command: str) -> bool:
        """Return whether the command is moving the robot or must still stop it."""
        return command in self._backend and self._backend[command].state != "idle"

    def owes_stop(self, command: str) -> bool:
        """Return whether the command may still move the robot; same as `is_stopping`."""
        return self.is_stopping(command)

    def is_open(self, command: str) -> bool:
        """Return whether the command's transport is connected."""
        return self.is_up

    def release(self, command: str) -> None:
        """Release the control."""
        if command in self._backend:
            self._backend[command].stop("released", self._clock.now())
        self.write_due()

    def stop(self, stops: Mapping[str, Payload | FrameVariants]) -> None:
        """Stop all motion."""
        for command, frame in stops.items():
            terms = HoldTerms(b"", period_s=0.05).stopped_by(frame)
            hold_to_run = self._backend.setdefault(command, HoldToRun(terms))
            hold_to_run.stop("stopped", self._clock.now())
        self.write_due()

    async def stops(self) -> Sequence[tuple[str, StopReport]]:
        """Wait until stops are written and return them."""
        return [await self._stops.get()]

    def write_due(self) -> None:
        """Write all frames that are due, including frames that waited for the transport."""
        now = self._clock.now()
        for command, hold_to_run in self._backend.items():
            while self.is_up and (data := hold_to_run.due(now, is_clear=True)) is not None:
                self._send_now(data, now)
                if data == hold_to_run.terms.stop and hold_to_run.reason is not None:
                    self.reasons.append(hold_to_run.reason)
                    self._stops.put_nowait((command, hold_to_run.reason))
        if self._alarm is not None:
            self._alarm.cancel()
        dues = [
            hold_to_run.deadline
            for hold_to_run in self._backend.values()
            if hold_to_run.deadline is not None
        ]
        self._alarm = (
            self._clock.call_at(min(dues), self.write_due) if dues and self.is_up else None
        )

    def _send_now(self, data: Payload, now: float) -> None:
        if isinstance(data, bytes):
            self.written.append((now, data.decode()))
            if self._write is not None:
                self._write(data)

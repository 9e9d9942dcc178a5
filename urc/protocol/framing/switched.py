"""The framing ``switch``: several framings on one stream, selected by the first bytes.

Theory of operation. All cases of a switch share one `ReceiveBuffer`. The first bytes of a frame
select the case. After each frame or violation, the next bytes select a case again. Bytes that match
no case are skipped.
"""

import re
from typing import NamedTuple, cast

from urc.model.driver import FramingSpec
from urc.protocol.framing.base import (
    SKIPPED,
    Decoder,
    FrameFault,
    Framing,
    FramingError,
    StreamDecoder,
)
from urc.protocol.framing.receive_buffer import ReceiveBuffer
from urc.protocol.framing.table import build_framing

__all__ = ["SwitchFraming"]


class SwitchFraming(NamedTuple):
    """A framing that selects one of several cases, in order, by the first bytes of a frame."""

    cases: tuple[tuple[bytes, Framing], ...]
    max_bytes: int
    otherwise: Framing | None = None
    """Framing for frames that match no case; None makes these frames invalid."""
    is_robot: bool = False
    """Whether the framing is for the robot's end of the connection, as in an emulated robot."""

    @classmethod
    def from_spec(cls, spec: FramingSpec) -> "SwitchFraming":
        """Return the framing for the options ``cases`` and ``otherwise``."""
        cases = cast("tuple[tuple[bytes, FramingSpec], ...]", spec.options["cases"])
        other = cast("FramingSpec | None", spec.options.get("otherwise"))
        built = tuple((first, build_framing(one)) for first, one in cases)
        return cls(built, spec.max_bytes, None if other is None else build_framing(other))

    def encode(self, payload: bytes) -> bytes:
        """Return the frame from the first case that matches `payload`."""
        refused = ""
        other = self.otherwise if self.is_robot and _is_text(payload) else None
        if other is not None and not any(payload.startswith(first) for first, _ in self.cases):
            return other.encode(payload)
        for first, framing in self.cases:
            try:
                frame = framing.encode(payload)
            except FramingError as error:
                refused = refused or str(error)
                continue
            if frame.startswith(first):
                return frame
        if self.otherwise is not None:
            frame = self.otherwise.encode(payload)
            if not any(frame.startswith(first) for first, _ in self.cases):
                return frame
            refused = "the frame would match another case of the framing"
        raise FramingError(refused or f"no case of the framing matches {payload[:40]!r}")

    def decoder(self, stream: ReceiveBuffer | None = None) -> Decoder:
        """Return a new decoder for received bytes."""
        shared = ReceiveBuffer() if stream is None else stream
        cases = [(first, framing.decoder(shared)) for first, framing in self.cases]
        other = None if self.otherwise is None else self.otherwise.decoder(shared)
        return _SwitchDecoder(
            shared,
            cast("list[tuple[bytes, StreamDecoder]]", cases),
            cast("StreamDecoder | None", other),
        )

    def reversed(self) -> "SwitchFraming":
        """Return the framing for the other end of the connection."""
        cases = tuple((first, framing.reversed()) for first, framing in self.cases)
        other = None if self.otherwise is None else self.otherwise.reversed()
        return self._replace(cases=cases, otherwise=other, is_robot=not self.is_robot)


def _is_text(payload: bytes) -> bool:
    """Return whether an emulated robot's payload has only printable ASCII, like a line of text."""
    return payload.isascii() and payload.decode("ascii").isprintable()


class _SwitchDecoder(StreamDecoder):
    def __init__(
        self,
        stream: ReceiveBuffer,
        cases: list[tuple[bytes, StreamDecoder]],
        other: StreamDecoder | None,
    ) -> None:
        super().__init__(stream, 0)
        self._cases = cases
        self._other = other
        self._any = re.compile(b"|".join(re.escape(first) for first, _ in cases))
        self._longest = max(len(first) for first, _ in cases)
        self._active: StreamDecoder | None = None

    @property
    def deadline(self) -> float | None:
        return None if self._active is None else self._active.deadline

    def restart(self) -> None:
        super().restart()
        self._active = None

    def push(self, data: bytes, now: float = 0.0) -> None:
        if self._active is None:
            super().push(data, now)
        else:
            self._active.push(data, now)

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        while True:
            if self._active is None:
                fault = self._choose()
                if fault is not None or self._active is None:
                    return fault
            found = self._active.next(now)
            if found is None:
                return None
            told = self._end_case(found)
            if told is not None:
                return told

    def tick(self, now: float) -> list[bytes | FrameFault]:
        if self._active is None:
            return []
        told = [self._end_case(found) for found in self._active.tick(now)]
        frames = [one for one in told if one is not None]
        while (frame := self.next(now)) is not None:
            frames.append(frame)
        return frames

    def _end_case(self, found: bytes | FrameFault) -> bytes | FrameFault | None:
        """Deselect the case after the result `found`; return None for a repeated violation."""
        self._active = None
        if isinstance(found, bytes):
            self._is_lost = False
            return found
        if found.code == SKIPPED:
            self._is_lost = False
            return found if self._is_case else None
        return self._lost(*found[:2], closes=found.closes)

    def _choose(self) -> FrameFault | None:
        """Select the case for the next frame and advance to that frame."""
        stream = self._stream
        if self._other is not None:
            self._choose_here(self._other)
            return None
        found = self._any.search(stream.data, stream.at)
        if found is None:
            # Keep the possible beginning of a case.
            place = max(stream.at, len(stream.data) - self._longest + 1)
            while not self._may_begin(bytes(stream.data[place:])):
                place += 1
        else:
            place = found.start()
        fault = self._skip(place - stream.at) if place > stream.at else None
        if found is not None:
            data = stream.data
            self._active = next(one for first, one in self._cases if data.startswith(first, place))
            self._active.restart()
        return fault

    def _choose_here(self, other: StreamDecoder) -> None:
        """Select the case for the frame at the next byte, or `other` if no case matches."""
        stream = self._stream
        front = bytes(stream.data[stream.at : stream.at + self._longest])
        chosen = next((one for first, one in self._cases if front.startswith(first)), None)
        if chosen is None and not self._may_begin(front):
            chosen = other
        if chosen is not None:
            self._active = chosen
            chosen.restart()

    def _may_begin(self, data: bytes) -> bool:
        return any(first.startswith(data) for first, _ in self._cases)

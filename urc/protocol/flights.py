"""What is in flight on one line: sent, and not answered yet.

Floor 3, pure. See `urc.protocol.line` for the theory of operation.
"""

from urc.protocol.exchange import Exchange, Flight, Offer
from urc.protocol.forms import Frame
from urc.protocol.framing import Framing

__all__ = ["Flights"]


class Flights(list[Flight]):
    """In the order of sending; those that are late stay until nobody expects them any more."""

    __slots__ = ()

    def drain(self) -> list[Exchange]:
        """Forget all; return the requests that still waited for an answer."""
        waited = [flight.exchange for flight in self if not flight.is_late]
        self.clear()
        return waited

    @property
    def waiting(self) -> int:
        """How many wait for an answer, real-time ones aside."""
        return sum(1 for flight in self if not flight.is_late and not flight.exchange.is_realtime)

    @property
    def deadline(self) -> float | None:
        """When the first of them is overdue."""
        if len(self) == 1:
            return self[0].due
        return min((flight.due for flight in self), default=None)

    @property
    def is_wary(self) -> bool:
        """Whether a late answer may still come that could be taken for another one's."""
        return any(
            flight.is_late and flight.exchange.ask.match is None and not flight.exchange.is_realtime
            for flight in self
        )

    def has(self, label: str) -> bool:
        """Return whether a request of that name waits for its answer."""
        return any(flight.exchange.ask.label == label and not flight.is_late for flight in self)

    def overdue(self, now: float) -> list[Flight]:
        """Return those whose time is over."""
        return [flight for flight in self if flight.due <= now] if self else []

    def framing(self) -> Framing | None:
        """Return what cuts the stream while an answer brings its own framing."""
        for flight in self:
            if flight.exchange.ask.framing is not None:
                return flight.exchange.ask.framing
        return None

    def collects_lines(self) -> bool:
        """Return whether any frame at all may be part of an answer."""
        return any(flight.ear.answer.lines is not None for flight in self)

    def offer(self, frame: Frame) -> tuple[Flight, Offer] | None:
        """Return whose answer the frame is and what it means, or None when it answers nobody."""
        if len(self) == 1:
            only = self[0].offer(frame)
            return None if only is None else (self[0], only)
        has_first, has_first_realtime = False, False
        collecting: list[Flight] = []
        for flight in self:
            if flight.exchange.ask.match is None:
                is_realtime = flight.exchange.is_realtime
                if has_first_realtime if is_realtime else has_first:
                    continue
                if not flight.is_late:  # what is late may never come: it blocks nobody's answer
                    has_first_realtime |= is_realtime
                    has_first |= not is_realtime
            if flight.ear.answer.lines is not None:
                collecting.append(flight)
                continue
            offer = flight.offer(frame)
            if offer is not None:
                return flight, offer
        for flight in collecting:  # last: any frame at all could be one of its lines
            offer = flight.offer(frame)
            if offer is not None:
                return flight, offer
        return None

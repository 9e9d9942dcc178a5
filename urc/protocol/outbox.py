"""What waits to be sent on one line, and when it may go.

Floor 3, pure. See `urc.protocol.line` for the theory of operation.
"""

from collections.abc import Callable, Mapping

from urc.expressions import COUNTERS
from urc.model.codec import Count, Numbered
from urc.model.driver import TransportSpec
from urc.protocol.exchange import Exchange, Outcome
from urc.protocol.flights import Flights
from urc.protocol.gate import Counters, Waiting

__all__ = ["Outbox", "written"]


class Outbox(Waiting[Exchange]):
    """The queue of one line, with its shortest gap and its limit of requests in flight."""

    __slots__ = ("_flights", "_limit", "_spec", "next_send", "size_of")

    def __init__(
        self, spec: TransportSpec, flights: Flights, size_of: Callable[[Exchange], int]
    ) -> None:
        super().__init__(spec.queue.depth)
        self._spec = spec
        self._flights = flights
        self.size_of = size_of
        """Bytes that a request takes on the wire."""
        self._limit = spec.queue.in_flight if spec.connection == "persistent" else 1
        self.next_send = float("-inf")
        """Before this time the shortest gap since the last request is not over."""

    def take(self, exchange: Exchange) -> tuple[Exchange, Outcome] | None:
        """Take a request; return the one that had to make room, and what becomes of it."""
        gone = self.put(exchange)
        if gone is None:
            return None
        if gone is not exchange and gone.latest_key and gone.latest_key == exchange.latest_key:
            return gone, Outcome("superseded", "a newer one took its place before it was sent")
        text = f"{self._spec.queue.depth} requests are waiting on {self._spec.name} already"
        return gone, Outcome("queue-full", text)

    def has(self, label: str) -> bool:
        """Return whether a request of that name waits."""
        return any(exchange.ask.label == label for exchange in self)

    def sent(self, exchange: Exchange, now: float) -> None:
        """Count a request that goes out now."""
        self.next_send = now + self._spec.min_gap_s
        if exchange.ask.bucket is not None:
            exchange.ask.bucket.take(now)

    def next(self, now: float, *, is_ready: bool) -> Exchange | None:
        """Return what is to be sent now, still in its place.

        Args:
            now: the time.
            is_ready: whether anybody may talk; else only what is privileged.
        """
        if not self:
            return None
        is_full = self._flights.waiting >= self._limit
        for exchange in self:
            if not (is_ready or exchange.is_privileged) or _free_at(exchange) > now:
                continue
            if self._flights.may_confuse(exchange):
                continue
            is_full = is_full or not self._has_room(exchange)
            return None if is_full or now < self.next_send else exchange
        return None

    def _has_room(self, exchange: Exchange) -> bool:
        """Return whether the robot's buffer takes it beside what it has not answered yet."""
        most = self._spec.queue.most_bytes
        return most is None or self._flights.size + self.size_of(exchange) <= most

    def is_free(self, exchange: Exchange, now: float) -> bool:
        """Return whether `exchange` may be sent at once, past an empty queue."""
        if self or self._flights or now < self.next_send:
            return False
        return self._has_room(exchange) and _free_at(exchange) <= now

    def wants_line(self, now: float) -> bool:
        """Return whether something could go if there were a connection."""
        return any(_free_at(exchange) <= now for exchange in self)

    def may_send_at(self, *, is_ready: bool) -> float | None:
        """Return when time alone lets something be sent; None when only an answer does."""
        if not self or self._flights.waiting >= self._limit:
            return None
        first: float | None = None
        barred_from = float("inf")
        """What has no room holds up what is behind it from the time at which it could go."""
        for exchange in self:
            if not (is_ready or exchange.is_privileged) or self._flights.may_confuse(exchange):
                continue
            time = max(self.next_send, _free_at(exchange))
            if not self._has_room(exchange):
                barred_from = min(barred_from, time)
            elif time < barred_from and (first is None or time < first):
                first = time
        return first


def _free_at(exchange: Exchange) -> float:
    """Return when its rate lets it go, and the wait before it is sent again."""
    bucket = exchange.ask.bucket
    return exchange.waits_until if bucket is None else max(bucket.free_at, exchange.waits_until)


def written(exchange: Exchange, counters: Counters, learnt: Mapping[str, object]) -> Numbered:
    """Make a frame with the next numbers of its counters; sent again, it keeps them.

    Args:
        exchange: of an ask that is made late.
        counters: of the connection.
        learnt: what its login has read.

    Raises:
        BadArgument: it cannot be written with these numbers, which are used up nevertheless.
    """
    draw = counters.draw()
    count = Count({}, {})
    try:
        data = exchange.ask.encode({**learnt, **exchange.namespace, COUNTERS: draw})
        count = draw.count
    finally:
        counters.count(draw)
    exchange.data, exchange.numbers = data, draw.values
    return Numbered(data, count)

"""The request queue of one connection, and the time of the next request.

Pure. See `urc.protocol.requests.conversation` for the theory of operation.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress

from urc.expressions import COUNTERS
from urc.model.driver import TransportSpec
from urc.model.payload import Count, Numbered, size_of
from urc.protocol.requests.encode import BadArgument
from urc.protocol.requests.exchange import Exchange, ExchangeOutcome
from urc.protocol.requests.pending_replies import PendingReplies
from urc.protocol.requests.rate import Counters, PriorityQueue

__all__ = ["RequestQueue", "render_retry", "rendered_size", "written"]


class RequestQueue(PriorityQueue[Exchange]):
    """The request queue of one connection, with a minimum gap and a limit on requests in flight."""

    __slots__ = ("_limit", "_pending_replies", "_spec", "next_send", "size_of")

    def __init__(
        self,
        spec: TransportSpec,
        pending_replies: PendingReplies,
        size_of: Callable[[Exchange], int],
    ) -> None:
        super().__init__(spec.queue.depth)
        self._spec = spec
        self._pending_replies = pending_replies
        self.size_of = size_of
        """Function that returns the size of a request as sent to the robot, in bytes."""
        self._limit = spec.queue.in_flight if spec.connection == "persistent" else 1
        self.next_send = float("-inf")
        """End time of the minimum gap after the last request, in seconds."""

    def submit(self, exchange: Exchange) -> tuple[Exchange, ExchangeOutcome] | None:
        """Queue a request; return the displaced request and its outcome, or None."""
        gone = self.push(exchange)
        if gone is None:
            return None
        if gone is not exchange and gone.latest_key and gone.latest_key == exchange.latest_key:
            text = "replaced by a newer request before it was sent"
            return gone, ExchangeOutcome("superseded", text)
        text = f"{self._spec.queue.depth} requests are already waiting on {self._spec.name}"
        return gone, ExchangeOutcome("queue-full", text)

    def has(self, label: str) -> bool:
        """Return whether a request with this label is queued."""
        return any(exchange.ask.label == label for exchange in self)

    def sent(self, exchange: Exchange, now: float) -> None:
        """Record that a request was sent."""
        self.next_send = now + self._spec.min_gap_s
        if exchange.ask.bucket is not None:
            exchange.ask.bucket.count(now)

    def next(self, now: float, *, is_ready: bool) -> Exchange | None:
        """Return the next request to send, without removing it.

        Args:
            now: current time, in seconds.
            is_ready: whether the connection is ready; otherwise, only privileged requests may be
                sent.
        """
        if not self:
            return None
        is_full = self._pending_replies.waiting >= self._limit
        for exchange in self:
            if not (is_ready or exchange.is_privileged) or _free_at(exchange) > now:
                continue
            if self._pending_replies.may_confuse(exchange):
                continue
            is_full = is_full or not self._has_room(exchange)
            return None if is_full or now < self.next_send else exchange
        return None

    def _has_room(self, exchange: Exchange) -> bool:
        """Return whether the request fits into the robot's receive buffer."""
        most = self._spec.queue.most_bytes
        return most is None or self._pending_replies.size + self.size_of(exchange) <= most

    def is_free(self, exchange: Exchange, now: float) -> bool:
        """Return whether `exchange` may be sent immediately, without queueing."""
        if self or self._pending_replies or now < self.next_send:
            return False
        return self._has_room(exchange) and _free_at(exchange) <= now

    def wants_line(self, now: float) -> bool:
        """Return whether a queued request could be sent now if there were a connection."""
        return any(_free_at(exchange) <= now for exchange in self)

    def may_send_at(self, *, is_ready: bool) -> float | None:
        """Return the earliest time for the next request; None while waiting for a reply."""
        if not self or self._pending_replies.waiting >= self._limit:
            return None
        first: float | None = None
        barred_from = float("inf")
        """Time from which later requests must wait for a request that does not fit into the robot's
        buffer."""
        for exchange in self:
            if not (is_ready or exchange.is_privileged) or self._pending_replies.may_confuse(
                exchange
            ):
                continue
            time = max(self.next_send, _free_at(exchange))
            if not self._has_room(exchange):
                barred_from = min(barred_from, time)
            elif time < barred_from and (first is None or time < first):
                first = time
        return first


def _free_at(exchange: Exchange) -> float:
    """Return the earliest send time that the rate limit and the retry delay allow."""
    bucket = exchange.ask.bucket
    return exchange.waits_until if bucket is None else max(bucket.free_at, exchange.waits_until)


def written(exchange: Exchange, counters: Counters, learnt: Mapping[str, object]) -> Numbered:
    """Render a frame with the next counter numbers; a retry keeps its numbers.

    Args:
        exchange: request that must be rendered when it is sent.
        counters: counters of the connection.
        learnt: values that the login has read, keyed by name.

    Raises:
        BadArgument: the frame cannot be encoded; its counter numbers are not used again.
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


def render_retry(exchange: Exchange, counters: Counters, learnt: Mapping[str, object]) -> None:
    """Render a repeated request again, with the same numbers but new nonces and times."""
    draw = counters.draw()
    draw.values.update(exchange.numbers)
    with suppress(BadArgument):  # the earlier rendering succeeded, and remains usable
        exchange.data = exchange.ask.encode({**learnt, **exchange.namespace, COUNTERS: draw})


def rendered_size(exchange: Exchange, counters: Counters, learnt: Mapping[str, object]) -> int:
    """Return the size of a request in bytes, without consuming counter numbers."""
    if exchange.data is not None:
        return size_of(exchange.data)
    try:
        names = {**learnt, **exchange.namespace, COUNTERS: counters.draw()}
        return size_of(exchange.ask.encode(names))
    except BadArgument:
        return 0  # the error is reported when the request is sent

"""The redundant socket of a page, for links with packet loss.

Layer 5. A lost packet delays all later data on the same TCP connection by at least one round trip.
If the retransmitted packet is lost too, the delay doubles and exceeds the duration of a lease.
Packet losses rarely affect two connections at the same time. A page on a link with packet loss
sends each message about held controls over both sockets and receives heartbeats over both. Each
message has a number. Only the first copy takes effect.

A redundant socket has no rights without a page. The socket joins a page with a key that only this
page has, and closes when the page closes.
"""

import msgspec
from starlette.websockets import WebSocketDisconnect

from urc.motion.freshness import DuplicateElimination
from urc.motion.link_age import LinkState
from urc.runtime.clock import Clock, within
from urc.web.drive.control_service import ControlService, OperatorSession
from urc.web.feed.client_socket import ClientSocket, FlowControl, TokenBucket
from urc.web.wire import drive as wire
from urc.web.wire.picture import as_frame

__all__ = ["CLOSE_NO_SEAT", "CLOSE_NOT_TAKEN", "KEY_WITHIN_S", "RedundantSocket"]

CLOSE_NO_SEAT = 4404
CLOSE_NOT_TAKEN = 4400
KEY_WITHIN_S = 5.0
"""Maximum wait for a socket's join message, in seconds."""
MESSAGES_PER_S = 2000

_hello = msgspec.json.Decoder(wire.JoinRedundant)
_said: msgspec.json.Decoder[wire.Doubled] = msgspec.json.Decoder(wire.Doubled)
_BAD = (msgspec.MsgspecError, UnicodeError, RecursionError)


class RedundantSocket:
    """One redundant socket."""

    def __init__(
        self, line: ClientSocket, controls: ControlService, clock: Clock, flow: FlowControl
    ) -> None:
        """Prepare the accepted socket `line`; `flow` is its flow control."""
        self._line = line
        self._controls = controls
        self._clock = clock
        self._flow = flow
        self._is_over = False
        self._allowance = TokenBucket(MESSAGES_PER_S, clock.now())

    async def serve(self) -> None:
        """Serve the socket until either side closes."""
        try:
            operator = await self._operator()
            if operator is None:
                await self._line.close(CLOSE_NO_SEAT, "no open page has this key")
                return
            if operator.spare is not None:
                operator.spare.end()
            operator.spare, operator.doubled = self, operator.doubled or DuplicateElimination()
            try:
                await self._listen(operator)
            finally:
                if operator.spare is self:
                    operator.spare = None
        except WebSocketDisconnect:
            pass

    def heartbeat(self, number: int, link: LinkState | None) -> None:
        """Send a heartbeat number, unless an earlier number is still unsent."""
        if self._flow.is_free():
            self._flow.write(as_frame(wire.encode_beat(number, link).encode(), is_text=True))

    def end(self) -> None:
        """Close the socket after its page has closed or opened a newer redundant socket."""
        self._is_over = True
        self._flow.abort()

    async def _operator(self) -> OperatorSession | None:
        try:
            async with within(self._clock, KEY_WITHIN_S):
                message = await self._line.receive()
            said = _hello.decode(message.get("text") or b"")
        except (TimeoutError, *_BAD):
            return None
        return self._controls.operator_of(said.key)

    async def _listen(self, operator: OperatorSession) -> None:
        while (message := await self._line.receive())["type"] != "websocket.disconnect":
            if not self._receive(operator, message.get("text") or message.get("bytes") or b""):
                await self._line.close(CLOSE_NOT_TAKEN, "only held controls may use this socket")
                return

    def _receive(self, operator: OperatorSession, data: str | bytes) -> bool:
        if self._is_over or not self._allowance.allow(self._clock.now()):
            return False
        try:
            said = _said.decode(data)
        except _BAD:
            return False
        if said.number > 0:  # without a number, duplicates cannot be found
            self._controls.handle(operator, said)
        return said.number > 0

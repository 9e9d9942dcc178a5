"""The server side of the socket that carries a page's images; see `urc.web.feed.picture_line`.

Layer 5. The socket has no rights without a page. It joins a page with the key from the page's
`HelloMessage`, and closes when the page closes.
"""

import msgspec
from starlette.websockets import WebSocketDisconnect

from urc.runtime.clock import Clock, within
from urc.web.feed.client_socket import ClientSocket, FlowControl, TokenBucket
from urc.web.feed.picture_line import PictureLine, PicturePages, TakeLine
from urc.wire.client_messages import JoinPictures

__all__ = ["CLOSE_NO_PAGE", "CLOSE_NOT_TAKEN", "KEY_WITHIN_S", "PictureSocket"]

CLOSE_NO_PAGE = 4404
CLOSE_NOT_TAKEN = 4400
KEY_WITHIN_S = 5.0
"""Maximum wait for the socket's first message, in seconds."""
MESSAGES_PER_S = 4000

_join = msgspec.json.Decoder(JoinPictures)
_BAD = (msgspec.MsgspecError, UnicodeError, RecursionError)


class PictureSocket:
    """One socket for images."""

    def __init__(
        self, line: ClientSocket, pages: PicturePages, clock: Clock, flow: FlowControl
    ) -> None:
        """Prepare the accepted socket `line`; `flow` is its flow control."""
        self._line = line
        self._pages = pages
        self._clock = clock
        self._flow = flow
        self._allowance = TokenBucket(MESSAGES_PER_S, clock.now())

    async def serve(self) -> None:
        """Serve the socket until either side closes."""
        try:
            take = await self._page()
            if take is None:
                await self._line.close(CLOSE_NO_PAGE, "no open page has this key")
                return
            pictures = PictureLine(self._flow, self._clock)
            take(pictures)
            try:
                await self._listen(pictures)
            finally:
                if pictures.is_used:
                    take(None)
        except WebSocketDisconnect:
            pass

    async def _page(self) -> TakeLine | None:
        try:
            async with within(self._clock, KEY_WITHIN_S):
                message = await self._line.receive()
            said = _join.decode(message.get("text") or b"")
        except (TimeoutError, *_BAD):
            return None
        return self._pages.find(said.key)

    async def _listen(self, pictures: PictureLine) -> None:
        def heard(data: bytes) -> bool:
            return self._allowance.allow(self._clock.now()) and pictures.confirmed(data)

        self._flow.listen(heard)
        while (message := await self._line.receive())["type"] != "websocket.disconnect":
            text = message.get("text") or ""
            if not heard(text.encode()):
                await self._line.close(CLOSE_NOT_TAKEN, "only confirmations may use this socket")
                return

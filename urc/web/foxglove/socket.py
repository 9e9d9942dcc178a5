"""The socket of the Foxglove server, and the token in the socket's address.

Layer 5. Viewers such as Foxglove run in browsers, where a program cannot add a header to a
WebSocket. The address may therefore contain the token: ``/api/v1/foxglove?token=TOKEN``. A request
with a token in its address may come from any site, because pages from other sites do not know the
token.
"""

import secrets
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from typing import Final
from urllib.parse import parse_qsl, urlencode
from weakref import WeakValueDictionary

from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket

from urc.runtime.clock import Clock, LoopClock
from urc.runtime.hub import Hub
from urc.runtime.server_recorder import ServerRecorder
from urc.web.feed.client_socket import SocketPeer
from urc.web.fleet.robots import RobotService
from urc.web.foxglove.calls import FoxgloveCalls, RunCommand
from urc.web.foxglove.client import FoxgloveClient
from urc.web.foxglove.offers import Offers, OfferSource, RobotCatalogue
from urc.web.foxglove.topics import HubMessages
from urc.web.serve.actors import stopper_of
from urc.web.serve.replies import told
from urc.web.serve.rights import SIGNED_IN, WATCH, ProtectedSocket
from urc.web.serve.visitor import peer_of, visitor_of
from urc.wire.foxglove import PATH, SUBPROTOCOLS, chosen_subprotocol

__all__ = ["TOKEN", "FoxgloveServer", "TokenInAddress"]

TOKEN: Final = "token"  # noqa: S105 - the name of a parameter
"""Query parameter that contains the token of a program."""
_SECOND_NS: Final = 1_000_000_000


class FoxgloveServer:
    """The Foxglove server of a dashboard."""

    def __init__(
        self,
        services: Callable[[], Mapping[str, RobotService]],
        run: RunCommand,
        followed: Callable[[Callable[[], None]], AbstractContextManager[None]],
        recorder: ServerRecorder,
        clock: Clock | None = None,
    ) -> None:
        """Prepare the server.

        Args:
            services: function that returns the robots, keyed by their names in URLs.
            run: function that runs a command.
            followed: function that takes a callback and returns a context. While the context is
                open, the callback is called after each change of rights.
            recorder: recorder of STOPs by visitors who have not signed in.
            clock: the clock.
        """
        self._services = services
        self._run = run
        self._followed = followed
        self._recorder = recorder
        self._clock: Clock = clock or LoopClock()
        self._session = secrets.token_hex(8)
        self._catalogue = RobotCatalogue()
        self._messages: WeakValueDictionary[Hub, HubMessages] = WeakValueDictionary()

    def routes(self) -> list[ProtectedSocket]:
        """Return the route of the socket."""
        return [ProtectedSocket(PATH, self.socket, SIGNED_IN)]

    async def socket(self, websocket: WebSocket) -> None:
        """Serve one client."""
        subprotocol = chosen_subprotocol(websocket.scope["subprotocols"])
        if subprotocol is None:
            text = f"expected one of the subprotocols {', '.join(SUBPROTOCOLS)}"
            await websocket.send_denial_response(told(400, text, "no-subprotocol"))
            return
        await websocket.accept(subprotocol)
        visitor = visitor_of(websocket)
        source = OfferSource(
            self._services,
            may_watch=lambda name: visitor.may(WATCH, name),
            is_let_in=lambda: visitor.best_role() is not None,
            peer=lambda name, service: _peer(websocket, name, service),
            messages=self._shared,
            catalogue=self._catalogue,
        )
        calls = FoxgloveCalls(self._run, lambda name: stopper_of(websocket, name), self._recorder)
        flow = websocket.scope["state"]["flow"]
        client = FoxgloveClient(
            websocket, flow, Offers(source), calls, self._clock, session=self._session
        )
        with self._followed(client.recheck):
            await client.serve()

    def _shared(self, hub: Hub, name: str, service: RobotService) -> HubMessages:
        """Return the messages of a hub, which all clients share."""
        found = self._messages.get(hub)
        if found is None:
            # A session has one offset, because a change to the system clock must not shift its
            # times.
            offset_ns = time.time_ns() - round(service.clock.now() * _SECOND_NS)
            found = HubMessages(
                name, service.robot.profile, lambda time_s: offset_ns + round(time_s * _SECOND_NS)
            )
            self._messages[hub] = found
        return found


class TokenInAddress:
    """ASGI middleware that moves a token from the socket's address into a header."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Call the application, with the token in a header instead of the query."""
        if scope["type"] == "websocket" and scope["path"] == PATH:
            scope = _with_token(scope)
        await self._app(scope, receive, send)


def _with_token(scope: Scope) -> Scope:
    query = parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)
    tokens = [value for name, value in query if name == TOKEN]
    if not tokens:
        return scope
    rest = urlencode([pair for pair in query if pair[0] != TOKEN]).encode()
    # The address replaces all other identities, so that a cookie never gives rights to a page
    # from another site.
    kept = [pair for pair in scope["headers"] if pair[0] not in (b"authorization", b"cookie")]
    header = (b"authorization", b"Bearer " + tokens[0].encode("latin-1", "replace"))
    state = {**scope.get("state", {}), "has_address_token": True}
    return {**scope, "query_string": rest, "headers": [*kept, header], "state": state}


def _peer(websocket: WebSocket, name: str, service: RobotService) -> SocketPeer:
    return peer_of(websocket, name, only_watches=service.robot.playback is not None)

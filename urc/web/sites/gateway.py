"""Passes requests and sockets of robots of other sites to the robot's site.

Layer 5. This ASGI middleware runs inside the access control. Each request carries an assertion of
who acts. The relay of a socket ends as soon as the visitor's role changes here, and the page then
connects again with the new role.
"""

import asyncio
import logging
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Final
from urllib.parse import quote

from starlette.types import ASGIApp, Receive, Scope, Send

from urc.fleet.bus import Lane
from urc.web.feed.client_socket import SocketFlow
from urc.web.serve.connection_quota import is_stop
from urc.web.serve.replies import told
from urc.web.serve.rights import WATCH, turn_away
from urc.web.serve.visitor import Visitor
from urc.web.sites.robot_names import FarName, far_query, far_target
from urc.web.sites.site_client import SiteClient, SiteFailed, relayed
from urc.web.sites.visitor_proof import VisitorProofs

__all__ = ["Gateway"]

RENEW_S: Final = 10.0
"""Interval at which an open socket renews its visitor's assertion, in seconds."""
_SOCKETS: Final[dict[str, Lane]] = {
    "/ws": "control",
    "/ws/spare": "control",
    "/ws/pictures": "data",
}
_UP: Final = frozenset(
    (b"accept", b"accept-language", b"content-type", b"if-none-match", b"last-event-id", b"range")
)
_DOWN: Final = frozenset(
    (
        *(b"content-type", b"content-length", b"cache-control", b"etag", b"content-disposition"),
        *(b"content-range", b"accept-ranges", b"last-modified", b"x-urc-old", b"x-urc-picture"),
    )
)
_HANDSHAKE: Final = (b"upgrade", b"sec-websocket-key", b"sec-websocket-version")

log = logging.getLogger(__name__)


class Gateway:
    """ASGI middleware for robots of other sites."""

    def __init__(
        self,
        app: ASGIApp,
        client: SiteClient,
        proofs: VisitorProofs,
        followed: Callable[[Callable[[], None]], AbstractContextManager[None]],
        refusal: Callable[[str], str],
    ) -> None:
        """Create the middleware.

        Args:
            app: the application for everything else.
            client: requests to other sites.
            proofs: headers that tell the other site who acts.
            followed: function that takes a callback and returns a context. While the context is
                open, the callback is called after each change of rights.
            refusal: function that returns why another site is refused; "" if it is not. STOP is
                always passed on.
        """
        self._app = app
        self._client = client
        self._proofs = proofs
        self._followed = followed
        self._refusal = refusal

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request to another site, or call the application."""
        if scope["type"] == "websocket" and scope["path"] in _SOCKETS:
            found = far_query(scope["query_string"])
            if found is not None:
                await self._socket(scope, receive, send, *found)
                return
        elif scope["type"] == "http":
            target = far_target(scope["path"])
            if target is not None:
                await self._request(scope, receive, send, *target)
                return
        await self._app(scope, receive, send)

    def _authorization(self, scope: Scope, far: FarName) -> tuple[bytes, bytes] | None:
        """Return the header with the visitor's assertion; None for a visitor without a role."""
        client = scope.get("client") or ("",)
        return self._proofs.header(scope["state"]["visitor"], str(client[0]), far)

    # Requests

    async def _request(
        self, scope: Scope, receive: Receive, send: Send, far: FarName, path: str
    ) -> None:
        visitor: Visitor = scope["state"]["visitor"]
        if not is_stop(scope["method"], scope["path"]):
            if not visitor.may(WATCH, str(far)):
                await told(403, WATCH.refusal)(scope, receive, send)
                return
            if refused := self._refusal(far.site):
                await told(502, refused, "site-failed")(scope, receive, send)
                return
        headers = [pair for pair in scope["headers"] if pair[0] in _UP]
        if (proof := self._authorization(scope, far)) is not None:
            headers.append(proof)
        query = scope["query_string"].decode("latin-1")
        target = f"{path}?{query}" if query else path
        has_begun = False
        try:
            body = await _body(receive)
            lane: Lane = "control" if scope["method"] == "POST" else "data"
            asking = self._client.request(
                far.site, scope["method"], target, headers, body, lane=lane
            )
            async with asking as response:
                kept = [pair for pair in response.headers if pair[0].lower() in _DOWN]
                begin = {"type": "http.response.start", "status": response.status}
                await send({**begin, "headers": kept})
                has_begun = True
                async for part in response.parts:
                    await send({"type": "http.response.body", "body": part, "more_body": True})
                await send({"type": "http.response.body", "body": b""})
        except SiteFailed as fault:
            if has_begun:  # a cut body must not look complete
                scope["state"]["abort"]()
                return
            await told(502, str(fault), "site-failed")(scope, receive, send)

    # Sockets

    async def _socket(
        self, scope: Scope, receive: Receive, send: Send, far: FarName, query: str
    ) -> None:
        visitor: Visitor = scope["state"]["visitor"]
        proof = self._authorization(scope, far)
        flow: SocketFlow = scope["state"]["flow"]
        near = flow.taken_over()
        if proof is None or not visitor.may(WATCH, str(far)):
            await turn_away(scope, receive, send, WATCH.refusal)
            return
        if refused := self._refusal(far.site):
            await turn_away(scope, receive, send, refused)
            return
        if near is None:
            return
        wanted = dict(scope["headers"])
        lines = [f"GET {scope['path']}?{query} HTTP/1.1".encode(), b"Host: localhost"]
        lines += [b"Connection: Upgrade", b": ".join(proof)]
        lines += [b": ".join((name, wanted[name])) for name in _HANDSHAKE if name in wanted]
        head = b"\r\n".join((*lines, b"", b""))
        lane = _SOCKETS[scope["path"]]
        ends: list[Callable[[], None]] = []
        role = visitor.role(str(far))

        def recheck() -> None:
            if visitor.role(str(far)) != role:
                for end in ends:
                    end()

        renewing = asyncio.create_task(self._renew(scope, far))
        try:
            with self._followed(recheck):
                await relayed(self._client, far.site, lane, head, near, ends.append)
        except SiteFailed as fault:
            near.resume_reading()
            await turn_away(scope, receive, send, str(fault))
        finally:
            renewing.cancel()

    async def _renew(self, scope: Scope, far: FarName) -> None:
        """Renew the visitor's assertion until cancelled; each request with an assertion does."""
        while True:
            await asyncio.sleep(RENEW_S)
            proof = self._authorization(scope, far)
            if proof is None:
                continue
            target = f"/api/v1/robots/{quote(far.robot, safe='')}/controls"
            try:
                asking = self._client.request(far.site, "GET", target, (proof,), lane="control")
                async with asking as response:
                    await response.whole()
            except SiteFailed as fault:
                log.info("%s", fault)


async def _body(receive: Receive) -> bytes:
    """Return the whole body; the page policy limits its size."""
    body = bytearray()
    while True:
        message = await receive()
        body += message.get("body", b"")
        if message["type"] != "http.request" or not message.get("more_body", False):
            return bytes(body)

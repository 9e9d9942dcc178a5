"""Access control of pages: admission of browsers with a key, and instructions for other browsers.

Layer 5. The module contains an ASGI middleware inside the page policy. STOP and the files of the
access page need no key.
"""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple
from urllib.parse import parse_qsl, quote, unquote, urlencode

from starlette.responses import HTMLResponse, JSONResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from urc.web.serve.access import PARAMETER, Access, Visitor
from urc.web.serve.connection_quota import is_stop
from urc.web.show.pages import PageHead, render
from urc.web.wire.messages import CLOSE_NOT_LET_IN, encode_error

__all__ = ["AccessMiddleware", "AccessPage", "Stoppable"]

SAID = "open the address that URC printed when it started: it has the key"
"""Refusal message for programs and sockets; `words.js` translates the message."""
_OPEN = re.compile(
    r"/healthz|/favicon\.ico|/app\.webmanifest|/sw\.js|/(?:static|vendor|words)/.+\.\w+"
)
"""Paths of static files without any data about a robot."""
_CODE = re.compile(r"/(?:static|vendor|words|widgets)/.+\.\w+")
"""Paths of the files that frames load, without the secret prefix."""
_HEADERS = {"cache-control": "no-store"}
_REFUSED = {**_HEADERS, "www-authenticate": 'Bearer realm="URC"'}


class Stoppable(NamedTuple):
    """A robot that STOP can stop."""

    name: str
    """Name of the robot in URLs."""
    title: str

    @property
    def stop_url(self) -> str:
        """The URL of the robot's STOP."""
        return f"/api/v1/robots/{quote(self.name, safe='')}/stop"


@dataclass(frozen=True, slots=True)
class AccessPage:
    """Context of ``door.html.j2``: instructions or a link to the page, and STOP buttons."""

    head: PageHead
    url: str
    """Path of the requested page; "" if only the printed address gives access."""
    is_old: bool
    """Whether the request had an invalid key; the page reports an invalid key first."""
    path: str
    """Path of this page, for the reload link. With a link on another site, the browser sends no
    cookie; with the reload link, the browser sends the cookie."""
    robots: tuple[Stoppable, ...]


class AccessMiddleware:
    """The middleware."""

    def __init__(
        self, app: ASGIApp, access: Access, robots: Callable[[], Iterable[Stoppable]]
    ) -> None:
        """Prepare.

        Args:
            app: the wrapped application.
            access: the keys and sessions of the server.
            robots: function that returns all robots that STOP can stop.
        """
        self._app = app
        self._access = access
        self._robots = robots

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward allowed requests to the application, and refuse all others."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        code = scope["path"].removeprefix(self._access.frame_code)
        if code != scope["path"] and _CODE.fullmatch(code) and scope["type"] == "http":
            scope["state"]["is_code"] = True
            await self._app({**scope, "path": code}, receive, send)
            return
        visitor: Visitor = scope["state"]["visitor"]
        query = parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)
        word = next((value for name, value in query if name == PARAMETER), None)
        is_let_in = self._access.is_open or visitor.standing != "stranger"
        if word is not None and scope["type"] == "http" and scope["method"] in ("GET", "HEAD"):
            answer = self._answer_to(word, query, scope)
            await answer(scope, receive, send)
        elif is_let_in or self._is_for_all(scope):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await _turn_away(receive, send)
        else:
            await self._refusal(scope)(scope, receive, send)

    def _is_for_all(self, scope: Scope) -> bool:
        if scope["type"] == "websocket":
            return False
        path = scope["path"]
        if is_stop(scope["method"], path):
            return True
        return scope["method"] in ("GET", "HEAD") and _OPEN.fullmatch(path) is not None

    def _answer_to(self, word: str, query: list[tuple[str, str]], scope: Scope) -> HTMLResponse:
        """Return the response to a request with a key in its query."""
        rest = urlencode([pair for pair in query if pair[0] != PARAMETER])
        # Never "//…", which would be another host.
        path = "/" + quote(scope["path"].lstrip("/"))
        url = f"{path}?{rest}" if rest else path
        session = self._access.admit(word)
        if session is None and scope["state"]["visitor"].standing == "stranger":
            return self._page(scope, url=url if self._access.is_open else "", is_old=True)
        # A page, not a redirect: browsers send no strict cookie after a redirect from another site.
        page = self._page(scope, url=url)
        if session is not None:
            is_secure = scope["scheme"] == "https"
            for line in self._access.cookies(session, scope["headers"], is_secure=is_secure):
                page.headers.append("set-cookie", line)
        return page

    def _refusal(self, scope: Scope) -> ASGIApp:
        if scope["path"].startswith("/api/") or scope["method"] not in ("GET", "HEAD"):
            return JSONResponse({"error": SAID}, 401, _REFUSED)
        return self._page(scope)

    def _page(self, scope: Scope, *, url: str = "", is_old: bool = False) -> HTMLResponse:
        path = scope["path"].split("/")
        robots = tuple(() if url else self._robots())
        asked = unquote(path[2]) if path[1:2] == ["robots"] and len(path) > 2 else ""
        page = AccessPage(
            head=PageHead(scope["state"]["nonce"], "URC"),
            url=url,
            is_old=is_old,
            path="/" + quote(scope["path"].lstrip("/")),
            robots=tuple(one for one in robots if one.name == asked) or robots,
        )
        html = render("door.html.j2", page)
        is_in = url and not is_old
        return HTMLResponse(html, 200 if is_in else 401, _HEADERS if is_in else _REFUSED)


async def _turn_away(receive: Receive, send: Send) -> None:
    """Accept a socket and close it with the reason; a page cannot read a refused handshake."""
    await receive()
    await send({"type": "websocket.accept"})
    await send({"type": "websocket.send", "text": encode_error("refused", SAID)})
    await send({"type": "websocket.close", "code": CLOSE_NOT_LET_IN, "reason": SAID})

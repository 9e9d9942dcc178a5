"""Access control of pages: admission of browsers with a key, and the sign-in page for all others.

Layer 5. The module contains an ASGI middleware inside the page policy. A visitor without a role
reaches only the routes whose right is `ANYONE`, among them STOP and the files of the sign-in page.
"""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple
from urllib.parse import parse_qsl, quote, unquote, urlencode

from starlette.responses import HTMLResponse
from starlette.routing import BaseRoute, Match
from starlette.types import ASGIApp, Receive, Scope, Send

from urc.web.serve.access import PARAMETER, Access
from urc.web.serve.replies import told
from urc.web.serve.rights import ANYONE, MAINTAIN_ANYWHERE, ProtectedRoute, turn_away
from urc.web.serve.visitor import Visitor
from urc.web.show.pages import PageHead, render
from urc.web.show.visitor_links import sees_audit
from urc.web.show.warnings import current_warnings
from urc.web.words import t

__all__ = ["AccessMiddleware", "AccessPage", "Stoppable"]

SAID = "open the address that URC printed when it started: it has the key"
"""Refusal message for programs and sockets; `words.js` translates the message."""
_CODE = re.compile(r"/(?:static|vendor|words|widgets)/.+\.\w+")
"""Paths of the files that frames load, without the secret prefix."""
_HEADERS = {"cache-control": "no-store"}
_LONGEST_AGENT = 200
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
        self,
        app: ASGIApp,
        access: Access,
        routes: Sequence[BaseRoute],
        robots: Callable[[], Iterable[Stoppable]],
    ) -> None:
        """Prepare.

        Args:
            app: the wrapped application.
            access: the identities and rights of the server.
            routes: the routes of the application.
            robots: function that returns all robots that STOP can stop.
        """
        self._app = app
        self._access = access
        self._open = [
            one for one in routes if isinstance(one, ProtectedRoute) and one.right == ANYONE
        ]
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
        if self._access.anonymous is not None:
            text = t("Sign-in is off: everyone on this network can drive these robots.")
            current_warnings.set((text,))
        visitor: Visitor = scope["state"]["visitor"]
        if not visitor.is_known and _has_token(scope):
            self._access.on_bad_token((scope.get("client") or ("",))[0])
        query = parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)
        word = next((value for name, value in query if name == PARAMETER), None)
        sees_audit.set(visitor.may(MAINTAIN_ANYWHERE))
        is_let_in = visitor.best_role() is not None
        if word is not None and scope["type"] == "http" and scope["method"] in ("GET", "HEAD"):
            answer = self._answer_to(word, query, scope)
            await answer(scope, receive, send)
        elif is_let_in or self._is_for_all(scope):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await turn_away(receive, send, SAID)
        else:
            await self._refusal(scope)(scope, receive, send)

    def _is_for_all(self, scope: Scope) -> bool:
        return any(one.matches(scope)[0] is Match.FULL for one in self._open)

    def _answer_to(self, word: str, query: list[tuple[str, str]], scope: Scope) -> HTMLResponse:
        """Return the response to a request with a key in its query."""
        rest = urlencode([pair for pair in query if pair[0] != PARAMETER])
        # Never "//…", which would be another host.
        path = "/" + quote(scope["path"].lstrip("/"))
        url = f"{path}?{rest}" if rest else path
        visitor: Visitor = scope["state"]["visitor"]
        client = scope.get("client") or ("",)
        secret = self._access.admit(word, place=client[0], agent=_agent(scope))
        if secret is None and not visitor.is_known:
            is_open = self._access.anonymous is not None
            return self._page(scope, url=url if is_open else "", is_old=True)
        # A page, not a redirect: browsers send no strict cookie after a redirect from another site.
        page = self._page(scope, url=url)
        if secret is not None:
            is_secure = scope["scheme"] == "https"
            for line in self._access.cookies(secret, scope["headers"], is_secure=is_secure):
                page.headers.append("set-cookie", line)
        return page

    def _refusal(self, scope: Scope) -> ASGIApp:
        if scope["path"].startswith("/api/") or scope["method"] not in ("GET", "HEAD"):
            refused = told(401, SAID)
            refused.headers.update(_REFUSED)
            return refused
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


def _has_token(scope: Scope) -> bool:
    """Return whether a request has a token, good or bad."""
    return any(
        name == b"authorization" and value[:7].lower() == b"bearer "
        for name, value in scope["headers"]
    )


def _agent(scope: Scope) -> str:
    """Return the browser's own name, cut to a length for lists."""
    found = (value for name, value in scope["headers"] if name == b"user-agent")
    return next(found, b"").decode("latin-1")[:_LONGEST_AGENT]

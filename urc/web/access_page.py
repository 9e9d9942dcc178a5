"""Access control for pages: visitors with a role are admitted; others get the sign-in page.

Layer 5. The ASGI middleware of this module runs inside the middleware of the page policy. A visitor
without a role can reach only routes with the right `ANYONE`, such as STOP and the sign-in page's
files.
"""

import re
from collections.abc import Iterator, Sequence
from urllib.parse import parse_qsl, quote, urlencode

from starlette.responses import HTMLResponse
from starlette.routing import BaseRoute, Match
from starlette.types import ASGIApp, Receive, Scope, Send

from urc.web.people.sign_in_page import SignInPages
from urc.web.serve.access import PARAMETER, Access
from urc.web.serve.browser_name import browser_name
from urc.web.serve.replies import told
from urc.web.serve.rights import (
    ADMINISTER,
    ANYONE,
    MAINTAIN_ANYWHERE,
    SITE,
    ProtectedRoute,
    turn_away,
)
from urc.web.serve.visitor import Visitor, is_loopback
from urc.web.show.shown_visitor import ShownVisitor, shown_visitor
from urc.web.show.visitor_links import sees_audit
from urc.web.show.warnings import current_warnings
from urc.web.words import t

__all__ = ["AccessMiddleware"]

SAID = "sign in, or open the address that URC printed when it started"
"""Refusal message for programs and sockets; `words.js` translates the message."""
_CODE = re.compile(r"/(?:static|vendor|words|widgets)/.+\.\w+")
"""Paths of the files that widget frames load, without the secret prefix."""
_HEADERS = {"cache-control": "no-store"}
_LONGEST_AGENT = 200
_REFUSED = {**_HEADERS, "www-authenticate": 'Bearer realm="URC"'}


class AccessMiddleware:
    """ASGI middleware that forwards only permitted requests."""

    def __init__(
        self,
        app: ASGIApp,
        access: Access,
        routes: Sequence[BaseRoute],
        pages: SignInPages,
    ) -> None:
        """Create the middleware.

        Args:
            app: the wrapped application.
            access: the identities and rights of the server.
            routes: the routes of the application.
            pages: the pages that sign visitors in.
        """
        self._app = app
        self._access = access
        self._open = [
            one for one in routes if isinstance(one, ProtectedRoute) and one.right in (ANYONE, SITE)
        ]
        self._pages = pages

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward permitted requests to the application and refuse all others."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        code = scope["path"].removeprefix(self._access.frame_code)
        if code != scope["path"] and _CODE.fullmatch(code) and scope["type"] == "http":
            scope["state"]["is_code"] = True
            await self._app({**scope, "path": code}, receive, send)
            return
        current_warnings.set(tuple(self._warnings(scope)))
        visitor: Visitor = scope["state"]["visitor"]
        if not visitor.is_known and _has_token(scope):
            self._access.on_bad_token((scope.get("client") or ("",))[0])
        shown_visitor.set(self._shown(visitor))
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
            await turn_away(scope, receive, send, SAID)
        else:
            await self._refusal(scope)(scope, receive, send)

    def _shown(self, visitor: Visitor) -> ShownVisitor:
        keeps_people = self._access.control.store is not None
        name = t("This computer") if visitor.is_local else visitor.identity.name
        return ShownVisitor(
            name,
            keeps_people and visitor.may(ADMINISTER),
            keeps_people,
            names_screen=visitor.is_local
            or (not visitor.is_known and visitor.best_role() is not None),
        )

    def _warnings(self, scope: Scope) -> Iterator[str]:
        """Yield the warnings that every page shows about the server and about this connection."""
        if self._access.anonymous is not None:
            yield t("Sign-in is off: everyone on this network can drive these robots.")
        client = scope.get("client") or ("",)
        if scope["scheme"] in ("http", "ws") and not is_loopback(client[0]):
            yield t("This connection is not encrypted: others on the network can read it.")
        if self._access.clock_warning:
            yield self._access.clock_warning

    def _is_for_all(self, scope: Scope) -> bool:
        return any(one.matches(scope)[0] is Match.FULL for one in self._open)

    def _answer_to(self, word: str, query: list[tuple[str, str]], scope: Scope) -> HTMLResponse:
        """Return the response to a request whose query contains a start key or single-use code."""
        rest = urlencode([pair for pair in query if pair[0] != PARAMETER])
        # The path must not begin with "//", which would name another host.
        path = "/" + quote(scope["path"].lstrip("/"))
        url = f"{path}?{rest}" if rest else path
        visitor: Visitor = scope["state"]["visitor"]
        client = scope.get("client") or ("",)
        secret = self._access.admit(word, place=client[0], agent=_agent(scope))
        if secret is None and not visitor.is_known:
            is_open = self._access.anonymous is not None
            return self._pages.response(scope, url=url if is_open else "", is_old=True, path=url)
        # Send a page, not a redirect: browsers withhold strict cookies after a redirect from
        # another site.
        page = self._pages.response(scope, url=url)
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
        return self._pages.response(scope)


def _has_token(scope: Scope) -> bool:
    """Return whether a request contains a program's token, even an invalid token."""
    return any(
        name == b"authorization" and value[:7].lower() == b"bearer "
        for name, value in scope["headers"]
    )


def _agent(scope: Scope) -> str:
    """Return a readable name for the request's browser and operating system."""
    found = (value for name, value in scope["headers"] if name == b"user-agent")
    return browser_name(next(found, b"").decode("latin-1")[:_LONGEST_AGENT])

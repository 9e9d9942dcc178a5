"""Plain HTTP requests on a TLS port, and TLS provided by a web server in front of URC.

Layer 5. The module contains two ASGI middlewares around the application. `TlsPort` redirects plain
HTTP to HTTPS. The exceptions are connections from this machine, STOP, and the pages that a device
needs before it trusts the certificate. `BehindProxy` sets the secure scheme for requests to public
names.
"""

import ipaddress
import re
from collections.abc import Iterable
from urllib.parse import quote

from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from urc._addresses import unmapped
from urc.web.serve.connection_quota import is_stop
from urc.web.serve.policy import (
    REFUSAL_HEADERS,
    Authority,
    is_host_allowed,
    own_names,
    parse_host,
)

__all__ = ["BehindProxy", "TlsPort"]

_SECURE = {"http": "https", "ws": "wss"}
_PLAIN = re.compile(
    r"/trust(?:/authority\.crt)?|/healthz|/favicon\.ico|/app\.webmanifest"
    r"|/(?:static|vendor|words)/.+\.\w+"
)
"""Paths that need no encryption, because their responses contain no data about robots."""


class TlsPort:
    """The middleware for a TLS port."""

    def __init__(self, app: ASGIApp, allowed_hosts: Iterable[str] = ()) -> None:
        """Create the middleware.

        Args:
            app: the application.
            allowed_hosts: host names to redirect, in addition to addresses and this machine's
                names.
        """
        self._app = app
        self._names = own_names() | {one.lower().removesuffix(".") for one in allowed_hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward the request, or redirect it to HTTPS."""
        is_secure = scope.get("scheme", "https") in ("https", "wss")  # a lifespan lacks a scheme
        if is_secure or _may_be_plain(scope):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": "use wss"})
        else:
            await _redirect(scope, self._names)(scope, receive, send)


class BehindProxy:
    """The middleware for a server with public names, behind a web server that provides TLS."""

    def __init__(self, app: ASGIApp, names: Iterable[str]) -> None:
        """Create the middleware.

        Args:
            app: the application.
            names: public host names with an optional port, as in a browser's address bar.
        """
        self._app = app
        self._names = {one for one in map(parse_host, names) if one is not None}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward the request, with the secure scheme if its host is a public name."""
        if scope["type"] != "lifespan" and _host(scope) in self._names:
            scope = {**scope, "scheme": _SECURE.get(scope["scheme"], scope["scheme"])}
        await self._app(scope, receive, send)


def _may_be_plain(scope: Scope) -> bool:
    if _is_near(scope.get("client")) and _is_near(scope.get("server")):
        return True
    if scope["type"] == "websocket":
        return False
    if is_stop(scope["method"], scope["path"]):
        return True
    return scope["method"] in ("GET", "HEAD") and _PLAIN.fullmatch(scope["path"]) is not None


def _is_near(place: tuple[str, int | None] | None) -> bool:
    """Return whether one end of a connection has a loopback address."""
    try:
        return place is not None and unmapped(ipaddress.ip_address(place[0])).is_loopback
    except ValueError:
        return False


def _redirect(scope: Scope, names: frozenset[str]) -> ASGIApp:
    """Return the response to a plain HTTP request that requires HTTPS."""
    host = _host(scope)
    headers = {name.decode(): value.decode() for name, value in REFUSAL_HEADERS}
    headers["cache-control"] = "no-store"
    if host is None or scope["method"] not in ("GET", "HEAD"):
        text = "This port requires HTTPS: use an address that begins with https://\n"
        return PlainTextResponse(text, 403, headers)
    if not is_host_allowed(host, names):
        return PlainTextResponse("This server accepts no requests to that host.\n", 421, headers)
    port = "" if host.port is None else f":{host.port}"
    query = scope["query_string"].decode("latin-1")
    path = "/" + quote(scope["path"].lstrip("/")) + (f"?{query}" if query else "")
    # The redirect is temporary, because the address may serve plain HTTP after the next start.
    return RedirectResponse(f"https://{host.host}{port}{path}", 307, headers)


def _host(scope: Scope) -> Authority | None:
    """Return the host of a request; None for a missing, repeated or invalid Host header."""
    found = [value for name, value in scope["headers"] if name == b"host"]
    return parse_host(found[0].decode("latin-1")) if len(found) == 1 else None

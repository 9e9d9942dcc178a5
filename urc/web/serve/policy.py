"""Access checks and the page policy for every request, before any route is looked up.

Layer 5. This ASGI middleware wraps the whole application, so that error responses also get the
policy's headers. The Host check refuses foreign host names that resolve to this machine. The Origin
check prevents foreign pages from opening a WebSocket or posting a form. The response headers block
injected markup. The module depends on no route, robot or template.
"""

import ipaddress
import re
import secrets
import socket
from collections.abc import Iterable
from typing import NamedTuple

from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from urc._addresses import unmapped
from urc.web.serve.access import Access
from urc.web.serve.connection_quota import ConnectionQuota, is_stop
from urc.web.serve.replies import API, told
from urc.web.serve.rights import turn_away

__all__ = [
    "BODY_BYTES",
    "REFUSAL_HEADERS",
    "Authority",
    "Policy",
    "frame_policy",
    "is_host_allowed",
    "is_origin_ours",
    "own_names",
    "parse_host",
]

BODY_BYTES = 1 << 20
"""Maximum size of an accepted request body, in bytes."""

_AUTHORITY = r"(?P<host>\[[0-9a-f:.]{2,45}\]|[a-z0-9_.-]{1,253})(?::(?P<port>[0-9]{1,5}))?"
_HOST = re.compile(_AUTHORITY, re.ASCII | re.IGNORECASE)
_ORIGIN = re.compile(r"(?P<scheme>https?)://" + _AUTHORITY, re.ASCII | re.IGNORECASE)
_LABEL = re.compile(r"[a-z0-9_](?:[a-z0-9_-]{0,61}[a-z0-9_])?", re.ASCII)
_DEFAULT_PORTS = {"http": 80, "https": 443, "ws": 80, "wss": 443}
_SAFE_METHODS = frozenset({"GET", "HEAD"})

_CONTENT_POLICY = (
    "default-src 'none'; script-src 'nonce-{nonce}' 'strict-dynamic'; "
    "style-src 'self' 'nonce-{nonce}'; img-src 'self' data: blob:; font-src 'self'; "
    "connect-src 'self'; frame-src 'self'; worker-src 'self'; manifest-src 'self'; "
    "base-uri 'none'; "
    "form-action 'none'; object-src 'none'; frame-ancestors 'none'; "
    "require-trusted-types-for 'script'; trusted-types urc"
)
_FIXED_HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (
        b"permissions-policy",
        # Only URC's own origin has the features needed for driving. All other features are off,
        # even for widgets.
        b"accelerometer=(self), gyroscope=(self), magnetometer=(self), gamepad=(self), "
        b"fullscreen=(self), screen-wake-lock=(self), camera=(), microphone=(), geolocation=(), "
        b"display-capture=(), payment=(), usb=(), serial=(), hid=(), midi=()",
    ),
)
_FRAME_POLICY = (
    "sandbox allow-scripts; default-src 'none'; script-src '{digest}' {code}; "
    "style-src 'unsafe-inline' {code}; img-src data: blob: {code}; font-src data: {code}; "
    "media-src data: blob:; connect-src 'none'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'self'; "
    "require-trusted-types-for 'script'; trusted-types urc"
)
_SENSORS = (
    *("accelerometer", "gyroscope", "magnetometer", "gamepad", "fullscreen", "screen-wake-lock"),
    *("camera", "microphone", "geolocation", "display-capture", "payment", "usb", "serial", "hid"),
    *("midi", "autoplay", "clipboard-read", "clipboard-write", "publickey-credentials-get"),
)
_FRAME_HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"SAMEORIGIN"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"permissions-policy", ", ".join(f"{name}=()" for name in _SENSORS).encode()),
)
_CODE_FOLDERS = ("static", "vendor", "words")
_CODE_HEADERS = (
    *(pair for pair in _FIXED_HEADERS if pair[0] != b"cross-origin-resource-policy"),
    # A frame without an origin shares no origin with any page. Its files are therefore open to
    # everyone with the path, that is, to URC's pages and their frames.
    (b"cross-origin-resource-policy", b"cross-origin"),
    (b"access-control-allow-origin", b"*"),
)

REFUSAL_HEADERS = (
    (b"content-security-policy", b"default-src 'none'; frame-ancestors 'none'"),
    *_FIXED_HEADERS,
)
"""Headers of a plain-text refusal that does not come from the application. These headers forbid all
scripts and resources."""


class Authority(NamedTuple):
    """A host and its port, from a ``Host`` or ``Origin`` header."""

    host: str
    """Host in lower case; an IPv6 address keeps its brackets."""
    port: int | None
    """Port number; None if the header contains no port."""


def parse_host(text: str) -> Authority | None:
    """Return the host and port of a ``Host`` header; None for an invalid header."""
    match = _HOST.fullmatch(text)
    return _authority(match) if match else None


def is_host_allowed(
    authority: Authority, names: frozenset[str], *, is_loopback: bool = False
) -> bool:
    """Return whether the server accepts requests to the host in `authority`.

    A foreign name server cannot use literal addresses or ``localhost`` for DNS rebinding. Any other
    name must be in `names`, because every device on the network can claim a name under ``.local``.

    Args:
        authority: the host.
        names: allowed names in lower case, including the names of this machine.
        is_loopback: whether to accept only loopback addresses, because the request came over
            loopback.
    """
    host = authority.host
    name = host.removesuffix(".")
    if name == "localhost" or name in names:
        return True
    try:
        address = ipaddress.ip_address(host[1:-1] if host.startswith("[") else host)
    except ValueError:
        return False
    if (address.version == 6) is not host.startswith("["):
        return False
    return unmapped(address).is_loopback if is_loopback else True


def own_names() -> frozenset[str]:
    """Return this machine's own names under ``.local``."""
    name = socket.gethostname().lower().removesuffix(".").removesuffix(".local")
    label = name.partition(".")[0]
    return frozenset({f"{label}.local"} if _LABEL.fullmatch(label) else ())


def is_origin_ours(origin: str, scheme: str, authority: Authority) -> bool:
    """Return whether `origin` exactly matches the scheme, host and port of the request.

    Args:
        origin: the Origin header; ``null`` never matches.
        scheme: request scheme, one of ``http``, ``https``, ``ws`` and ``wss``.
        authority: host and port of the request.
    """
    match = _ORIGIN.fullmatch(origin)
    theirs = _authority(match) if match else None
    if match is None or theirs is None:
        return False
    default = _DEFAULT_PORTS[scheme]
    return (
        match["scheme"].lower() == ("https" if scheme in ("https", "wss") else "http")
        and theirs.host == authority.host
        and (theirs.port or default) == (authority.port or default)
    )


def frame_policy(scope: Scope, widget: str, digest: str, place: str) -> str:
    """Return a frame's policy, which permits only code from URC and from one widget.

    The policy has no nonce, because a nonce would permit scripts and styles from any address. Any
    request to a foreign address can leak data. The digest permits only the import map.

    Args:
        scope: ASGI scope of the request for the frame; its host has been checked.
        widget: name of the widget in URLs.
        digest: digest ``sha256-…`` of the import map.
        place: path prefix of the frames' code.
    """
    authority = parse_host(_values(scope, b"host")[0])
    # CSP sources cannot contain IPv6 addresses.
    if authority is None or authority.host.startswith("["):
        return _FRAME_POLICY.format(digest=digest, code="'self'")
    port = "" if authority.port is None else f":{authority.port}"
    origin = f"{scope['scheme']}://{authority.host}{port}"
    folders = (*_CODE_FOLDERS, f"widgets/{widget}")
    code = " ".join(f"{origin}{place}/{folder}/" for folder in folders)
    return _FRAME_POLICY.format(digest=digest, code=code)


class Policy:
    """Middleware for the page policy; stores ``nonce`` and ``visitor`` in the request state."""

    def __init__(self, app: ASGIApp, access: Access, *, allowed_hosts: Iterable[str] = ()) -> None:
        self._app = app
        self._access = access
        self._names = frozenset(name.lower().removesuffix(".") for name in allowed_hosts)
        self._own = own_names()
        self._places = ConnectionQuota()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse the request, or call the application and add headers to its response."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        nonce = secrets.token_urlsafe(16)
        state = scope.setdefault("state", {})
        state["nonce"] = nonce
        refused = ""
        if (peer := state.get("site")) is not None:
            state["visitor"], refused = self._access.visitor_from(
                peer, scope["headers"], scope["path"]
            )
        else:
            state["visitor"] = self._access.visitor(
                scope["headers"], is_secure=scope["scheme"] in ("https", "wss")
            )
        answer = _Answer(scope, send, nonce)
        is_stopping = is_stop(scope.get("method", ""), scope["path"])
        refusal = (403, refused) if refused and not is_stopping else self._refusal(scope)
        if refused and scope["type"] == "websocket":
            await turn_away(scope, receive, send, refused)
        elif refusal is not None:
            await answer.refuse(*refusal)
        elif is_stopping:
            await self._app(scope, _limited(scope, receive), answer.send)
        else:
            client = scope.get("client") or ("",)
            with self._places.taken(state["visitor"], client[0]) as has_place:
                if has_place:
                    await self._app(scope, _limited(scope, receive), answer.send)
                else:
                    await answer.refuse(503, "Too many requests from this address are in progress.")

    def _refusal(self, scope: Scope) -> tuple[int, str] | None:
        hosts = _values(scope, b"host")
        authority = parse_host(hosts[0]) if len(hosts) == 1 else None
        is_near = _is_loopback(scope)
        names = self._names if is_near else self._names | self._own
        if authority is None or not is_host_allowed(authority, names, is_loopback=is_near):
            shown = authority.host if authority is not None else "that host name"
            return 421, f"This server accepts no requests to {shown}; use --allow-host to allow it."
        is_upgrade = scope["type"] == "websocket"
        if is_upgrade or scope["method"] not in _SAFE_METHODS:
            origins = _values(scope, b"origin")
            visitor = scope["state"]["visitor"]
            if not origins and visitor.is_program:
                pass  # pages from other sites cannot send a token
            elif scope["state"].get("has_address_token") and visitor.is_known:
                pass  # pages from other sites do not know the token
            elif len(origins) != 1 or not is_origin_ours(origins[0], scope["scheme"], authority):
                return 403, "Only this server's own pages may send this request."
        lengths = _values(scope, b"content-length")
        if lengths and _values(scope, b"transfer-encoding"):
            # A web server in front of URC may interpret the rest of the body as the next request.
            return 400, "A request cannot have both a content length and a transfer encoding."
        if any(not text.isdecimal() or int(text[:20]) > BODY_BYTES for text in lengths):
            return 413, f"A request may have at most {BODY_BYTES} bytes."
        return None


class _Answer:
    """A wrapper around `send` that adds the page policy's headers to a response.

    A route may set three keys in the request state. ``frame_policy`` is a frame's policy, which
    replaces the page policy. ``is_code`` marks files that frames may also load. ``is_file`` marks
    third-party content, which must not act as a URC page when opened directly.
    """

    def __init__(self, scope: Scope, send: Send, nonce: str) -> None:
        self._send = send
        self._state = scope["state"]
        self._is_upgrade = scope["type"] == "websocket"
        self._is_call = not self._is_upgrade and scope["path"].startswith(API)
        self._can_explain = "websocket.http.response" in (scope.get("extensions") or {})
        self._has_begun = False
        self._policy = _CONTENT_POLICY.format(nonce=nonce)

    def _headers(self) -> list[tuple[bytes, bytes]]:
        framed = self._state.get("frame_policy")
        fixed = _CODE_HEADERS if self._state.get("is_code") else _FIXED_HEADERS
        if framed is not None:
            fixed = _FRAME_HEADERS
        policy = framed or self._policy
        if self._state.get("is_file"):
            policy = f"sandbox; {policy}"
        return [(b"content-security-policy", policy.encode()), *fixed]

    async def send(self, message: Message) -> None:
        kind = message["type"]
        if kind in ("http.response.start", "websocket.http.response.start"):
            self._has_begun = True
            headers = self._headers()
            ours = {name for name, _ in headers}
            theirs = [pair for pair in message.get("headers", ()) if pair[0].lower() not in ours]
            message = {**message, "headers": [*theirs, *headers]}
        elif kind == "websocket.accept":
            self._has_begun = True
        elif kind == "websocket.close" and not self._has_begun:
            # The server's own refusal of an unknown route would lack the policy's headers.
            await self.refuse(404, "This page does not exist.")
            return
        await self._send(message)

    async def refuse(self, status: int, text: str) -> None:
        """Respond with one line of text, as JSON for API calls and otherwise as plain text."""
        if self._is_upgrade and not self._can_explain:
            self._has_begun = True
            await self._send({"type": "websocket.close", "code": 1008, "reason": text})
            return
        prefix = "websocket.http.response" if self._is_upgrade else "http.response"
        body, media = text.encode() + b"\n", b"text/plain; charset=utf-8"
        if self._is_call:
            body, media = bytes(told(status, text).body), b"application/json"
        headers = [
            (b"content-type", media),
            (b"content-length", str(len(body)).encode()),
            (b"cache-control", b"no-store"),
        ]
        if status == 400:
            headers.append((b"connection", b"close"))  # RFC 9112, section 6.1
        await self.send({"type": f"{prefix}.start", "status": status, "headers": headers})
        await self._send({"type": f"{prefix}.body", "body": body})


def _limited(scope: Scope, receive: Receive) -> Receive:
    """Return a version of `receive` that limits the total size of the request's body."""
    if scope["type"] == "websocket":
        return receive
    total = 0

    async def counted() -> Message:
        nonlocal total
        message = await receive()
        total += len(message.get("body", b""))
        if total > BODY_BYTES:
            raise HTTPException(413, f"A request may have at most {BODY_BYTES} bytes.")
        return message

    return counted


def _authority(match: re.Match[str]) -> Authority | None:
    port = int(match["port"]) if match["port"] else None
    if port is not None and not 0 < port < 65536:
        return None
    return Authority(match["host"].lower(), port)


def _is_loopback(scope: Scope) -> bool:
    """Return whether a request comes over loopback and therefore from this machine."""
    client = scope.get("client")
    try:
        return client is not None and unmapped(ipaddress.ip_address(client[0])).is_loopback
    except ValueError:
        return False


def _values(scope: Scope, name: bytes) -> list[str]:
    return [value.decode("latin-1") for key, value in scope["headers"] if key == name]

"""Requests from trusted proxies: the person in the proxy's header becomes the request's visitor.

Layer 5. This is the outermost ASGI middleware. The middleware removes proxy headers from all
requests, so the rest of the server never sees a forged header.

Theory of operation. Each request contains a secret that proves that it comes from the proxy. A
browser's first request opens a sign-in, whose secret never leaves this process. The middleware adds
the sign-in's secret to the request's cookies, so the same rules for rights, origin and revocation
apply as for a browser.
"""

import asyncio
import logging
import time
from collections import OrderedDict
from collections.abc import Sequence
from typing import Final, NamedTuple

from starlette.types import ASGIApp, Receive, Scope, Send

from urc.access.directory import NOBODY, Principal
from urc.access.external_accounts import admit_named
from urc.access.grants import AccessError
from urc.access.proxies import ProxiedRequest, TrustedProxy, without_proxy_headers
from urc.web.people.browser_sign_ins import BrowserSignIns
from urc.web.serve.access import SECURE
from urc.web.serve.connection_quota import is_stop
from urc.web.serve.policy import REFUSAL_HEADERS

__all__ = ["MOST_PROXIED", "ProxyMiddleware"]

MOST_PROXIED: Final = 1000
"""Maximum number of remembered browsers; above it, the least recently used is forgotten."""
_LASTS_S: Final = 12 * 3600.0
_TELL_S: Final = 60.0
_REFUSED_S: Final = 5.0

log = logging.getLogger(__name__)


class _Browser(NamedTuple):
    user: str
    proxy: str
    agent: str


class ProxyMiddleware:
    """The outermost middleware."""

    def __init__(
        self, app: ASGIApp, sign_ins: BrowserSignIns, proxies: Sequence[TrustedProxy]
    ) -> None:
        """Create the middleware.

        Args:
            app: the wrapped application, with the page policy.
            sign_ins: the sign-ins of all browsers.
            proxies: the trusted proxies.
        """
        self._app = app
        self._sign_ins = sign_ins
        self._proxies = proxies
        self._secrets: OrderedDict[_Browser, str] = OrderedDict()
        self._refused: dict[str, tuple[float, str]] = {}
        self._lock = asyncio.Lock()
        self._told_at = float("-inf")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward the request without proxy headers but with the person's sign-in."""
        if scope["type"] not in ("http", "websocket") or not self._proxies:
            await self._app(scope, receive, send)
            return
        found = without_proxy_headers(scope["headers"], self._proxies)
        scope = {**scope, "headers": found.headers}
        if found.fault:
            self._tell(found.fault)
        if found.proxy is not None and found.user:
            try:
                secret = await self._secret(scope, found, found.proxy)
            except AccessError as error:
                # STOP does not need a signed-in person.
                if scope["type"] == "http" and not is_stop(scope["method"], scope["path"]):
                    name = found.proxy.name
                    await _refuse(send, f"The sign-in by the proxy {name} was refused: {error}")
                    return
            else:
                is_secure = scope["scheme"] in ("https", "wss")
                scope["headers"] = self._as_person(found.headers, secret, is_secure=is_secure)
        await self._app(scope, receive, send)

    def _as_person(
        self, headers: Sequence[tuple[bytes, bytes]], secret: str, *, is_secure: bool
    ) -> list[tuple[bytes, bytes]]:
        """Return the headers, with the person's sign-in in place of the browser's sign-ins."""
        access = self._sign_ins.access
        names = (access.cookie, access.sign_in_cookie)
        ours = {each.encode() for name in names for each in (name, SECURE + name)}
        kept = []
        for name, value in headers:
            if name == b"cookie":
                parts = [part.strip() for part in value.split(b";")]
                value = b"; ".join(one for one in parts if one.partition(b"=")[0] not in ours)
            kept.append((name, value))
        before = SECURE if is_secure else ""
        return [*kept, (b"cookie", f"{before}{access.sign_in_cookie}={secret}".encode())]

    async def _secret(self, scope: Scope, found: ProxiedRequest, proxy: TrustedProxy) -> str:
        user = " ".join(found.user.split())
        agents = [value for name, value in found.headers if name == b"user-agent"]
        agent = agents[0].decode("latin-1")[:200] if agents else ""
        browser = _Browser(user.casefold(), proxy.name, agent)
        secret = self._known(browser)
        if secret is not None:
            return secret
        # A page loads dozens of files. A refused person must not cause a transaction for each file.
        at, reason = self._refused.get(browser.user, (float("-inf"), ""))
        if time.monotonic() - at < _REFUSED_S:
            raise AccessError(reason)
        async with self._lock:
            secret = self._known(browser)  # another request from this browser may have been faster
            if secret is None:
                try:
                    secret = await self._opened(scope, user, proxy, agent)
                except AccessError as error:
                    if len(self._refused) >= MOST_PROXIED:
                        self._refused.clear()
                    self._refused[browser.user] = (time.monotonic(), str(error))
                    raise
                self._secrets[browser] = secret
                while len(self._secrets) > MOST_PROXIED:
                    self._secrets.popitem(last=False)
            return secret

    def _known(self, browser: _Browser) -> str | None:
        """Return the browser's sign-in secret; None if it ended or the person was renamed."""
        secret = self._secrets.get(browser)
        who = self._sign_ins.control.identify(secret) if secret is not None else NOBODY
        if who == NOBODY or who.name.casefold() != browser.user:
            self._secrets.pop(browser, None)
            return None
        self._secrets.move_to_end(browser)
        return secret

    async def _opened(self, scope: Scope, user: str, proxy: TrustedProxy, agent: str) -> str:
        control, now = self._sign_ins.control, self._sign_ins.control.now()
        store = control.store
        if store is None:
            raise AccessError("this server has no list of people")
        client = scope.get("client") or ("",)
        place = str(client[0])

        def opened() -> tuple[Principal, str]:
            ends_at = now + _LASTS_S
            person = admit_named(
                store, user, proxy.new_people, proxy=proxy.name, now=now, ends_at=ends_at
            )
            _, secret = store.open_sign_in(
                person.id, "proxy", now=now, ends_at=ends_at, place=place, agent=agent
            )
            return person, secret

        person, secret = await asyncio.to_thread(opened)
        await control.reload()
        self._sign_ins.record(control.identify(secret), place, agent)
        log.info("the proxy %s signed %s in", proxy.name, person.name)
        return secret

    def _tell(self, fault: str) -> None:
        """Log a fault, at most once a minute, because clients can cause any number of faults."""
        now = time.monotonic()
        if now - self._told_at >= _TELL_S:
            self._told_at = now
            log.warning("%s: the header was removed", fault)


async def _refuse(send: Send, text: str) -> None:
    body = text.encode() + b"\n"
    headers = [
        (b"content-type", b"text/plain; charset=utf-8"),
        (b"content-length", str(len(body)).encode()),
        (b"cache-control", b"no-store"),
        *REFUSAL_HEADERS,
    ]
    await send({"type": "http.response.start", "status": 403, "headers": headers})
    await send({"type": "http.response.body", "body": body})

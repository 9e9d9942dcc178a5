"""The end of every way to sign in with a browser: limits, audit entries, and the sign-in itself.

Layer 5. Failed attempts of an address make its next attempts wait. STOP is never affected.
"""

import asyncio
import math
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import wraps
from typing import Any, Final

from starlette.requests import Request
from starlette.responses import Response

from urc.access.control import AccessControl
from urc.access.directory import Identity, Principal, Way
from urc.access.grants import AccessError
from urc.access.pending import place_of
from urc.access.store import AccessStore
from urc.access.throttle import Throttle
from urc.runtime.server_recorder import Actor, ServerRecorder
from urc.web.serve.access import Access
from urc.web.serve.replies import ApiError, told
from urc.web.serve.visitor import visitor_of

__all__ = [
    "IDLE_S", "LONGEST_S", "BrowserSignIns", "address_of", "agent_of", "answers_refusals",
]  # fmt: skip

LONGEST_S: Final = 7 * 24 * 3600.0
"""Longest life of a sign-in in a browser, in seconds."""
IDLE_S: Final = 12 * 3600.0
"""Longest time without use of a sign-in in a browser, in seconds."""
_LONGEST_AGENT: Final = 200
_Handler = Callable[[Any, Request], Awaitable[Response]]


class BrowserSignIns:
    """The sign-ins of all browsers of one server."""

    def __init__(
        self,
        access: Access,
        recorder: ServerRecorder,
        throttle: Throttle | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Prepare.

        Args:
            access: identities and rights.
            recorder: recorder of sign-ins in the audit log.
            throttle: failed attempts of all ways to sign in; None for separate ones.
            clock: source of monotonic time in seconds.
        """
        self.access = access
        self.recorder = recorder
        self._throttle = throttle or Throttle()
        self._clock = clock

    @property
    def control(self) -> AccessControl:
        """The identities and rights."""
        return self.access.control

    @property
    def store(self) -> AccessStore:
        """The store of people; raise `ApiError` for a server without one."""
        store = self.control.store
        if store is None:
            raise ApiError(404, "this server keeps no people")
        return store

    def check_wait(self, request: Request) -> None:
        """Raise `ApiError` 429 while attempts of the request's address must wait."""
        wait_s = self._throttle.wait_s(self._clock(), place_of(address_of(request)))
        if wait_s > 0:
            seconds = math.ceil(wait_s)
            raise ApiError(429, f"too many attempts from this address: wait {seconds} s")

    def failed(self, request: Request, way: Way, error: AccessError) -> None:
        """Count a failed attempt, and record it."""
        place = address_of(request)
        self._throttle.failed(self._clock(), place_of(place))
        self.recorder.sign_in_failed(way, place, str(error))

    async def open(
        self,
        request: Request,
        response: Response,
        person: Principal,
        way: Way,
        *,
        ends_at: float | None = None,
    ) -> Identity:
        """Sign a person in: open a sign-in, and store it in the browser.

        Args:
            request: the request that has proven the person.
            response: response that gets the cookie.
            person: the person.
            way: the way to sign in.
            ends_at: UTC time of the end, in seconds since 1970; None for the usual one.

        Raises:
            AccessError: the person was removed, or has no role.
        """
        if not person.grants:
            raise AccessError(f"{person.name!r} has no role here: ask an administrator")
        now = self.control.now()
        latest = now + LONGEST_S
        _, secret = await asyncio.to_thread(
            self.store.open_sign_in, person.id, way, now=now,
            ends_at=latest if ends_at is None else min(ends_at, latest), idle_s=IDLE_S,
            place=address_of(request), agent=agent_of(request),
        )  # fmt: skip
        await self._end_previous(request)
        who = self.control.identify(secret)
        is_secure = request.url.scheme == "https"
        for line in self.access.cookies(
            secret, request.scope["headers"], is_secure=is_secure, is_kept=True
        ):
            response.headers.append("set-cookie", line)
        self.record(who, address_of(request), agent_of(request))
        return who

    def record(self, who: Identity, place: str, agent: str) -> None:
        """Record a new sign-in in the audit log."""
        role = self.control.best_role(who) or ""
        actor = Actor(who.name, who.principal, who.kind, role, who.way, place, who.sign_in)
        self.recorder.signed_in(actor, agent)

    async def _end_previous(self, request: Request) -> None:
        """End the sign-in of a person that this browser had before, and read the new one."""
        before = visitor_of(request).identity
        if before.kind == "person" and before.way != "token":
            # It may have ended meanwhile, in another way.
            with suppress(AccessError):
                await self.control.end_sign_in(before.sign_in)
                return
        await self.control.reload()


def answers_refusals(handler: _Handler) -> _Handler:
    """Turn each error of a handler about people into a response of one line."""

    @wraps(handler)
    async def handle(self: Any, request: Request) -> Response:
        try:
            return await handler(self, request)
        except ApiError as failure:
            return told(failure.status, failure.line)
        except AccessError as error:
            return told(403, str(error))

    return handle


def address_of(request: Request) -> str:
    """Return the network address of a request, "" if it is unknown."""
    return request.client.host if request.client else ""


def agent_of(request: Request) -> str:
    """Return the browser's own name, cut to a length for lists."""
    return request.headers.get("user-agent", "")[:_LONGEST_AGENT]

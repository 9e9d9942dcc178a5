"""Code that all browser sign-in methods share: limits, audit entries and the sign-in itself.

Layer 5. Failed attempts delay later attempts from the same address or for the same name. STOP is
never delayed.
"""

import asyncio
import math
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from typing import Final

from starlette.requests import Request
from starlette.responses import Response

from urc.access.control import AccessControl
from urc.access.directory import Identity, Principal, Way
from urc.access.grants import AccessError
from urc.access.lifetimes import PERSON
from urc.access.pending import place_of
from urc.access.store import AccessStore
from urc.access.throttle import Throttle
from urc.runtime.server_recorder import Actor, ServerRecorder
from urc.web.serve.access import Access
from urc.web.serve.browser_name import browser_name
from urc.web.serve.replies import ApiError, answers_errors_with
from urc.web.serve.visitor import visitor_of
from urc.web.words import t

__all__ = [
    "BrowserSignIns",
    "address_of",
    "agent_of",
    "answers_changes",
    "answers_refusals",
]

answers_changes: Final = answers_errors_with(422)
"""Decorator for handlers that change people, devices or sign-ins."""
answers_refusals: Final = answers_errors_with(403)
"""Decorator for handlers that admit or refuse a visitor."""

HASHES: Final = 2
"""Maximum number of passphrases hashed at the same time; each hash needs 64 MiB of memory."""
MOST_WAITING: Final = 32
"""Maximum number of sign-in attempts that wait for their passphrase to be hashed."""
_LONGEST_AGENT: Final = 200


class BrowserSignIns:
    """The sign-ins of all browsers on one server."""

    def __init__(
        self,
        access: Access,
        recorder: ServerRecorder,
        throttle: Throttle | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Create the object that all sign-in methods of a server share.

        Args:
            access: identities and rights.
            recorder: recorder that writes sign-ins to the audit log.
            throttle: counter of failed attempts, shared by all sign-in methods; None to create a
                counter.
            clock: function that returns the monotonic time, in seconds.
        """
        self.access = access
        self.recorder = recorder
        self._throttle = throttle or Throttle()
        self._clock = clock
        self._hashes = asyncio.Semaphore(HASHES)
        self._waiting = 0

    @property
    def control(self) -> AccessControl:
        """The server's identities and rights."""
        return self.access.control

    @property
    def store(self) -> AccessStore:
        """The store of people; raise `ApiError` for a server without a store."""
        store = self.control.store
        if store is None:
            raise ApiError(404, t("This server has no list of people."))
        return store

    def check_wait(self, request: Request, *names: str) -> None:
        """Raise `ApiError` 429 while attempts from the request's address or for a name are delayed.

        Args:
            request: the attempt.
            names: additional keys for counting the attempt, such as the person's name.
        """
        wait_s = self._throttle.wait_s(self._clock(), place_of(address_of(request)), *names)
        if wait_s > 0:
            seconds = math.ceil(wait_s)
            raise ApiError(429, t("Too many attempts: wait {seconds} s.", seconds=seconds))

    def failed(
        self, request: Request, way: Way, error: AccessError, *names: str, person: str = ""
    ) -> None:
        """Count a failed attempt, and record the attempt in the audit log.

        Args:
            request: the attempt.
            way: the sign-in method.
            error: the reason.
            names: additional keys of the attempt, as for `check_wait`.
            person: id of the person in the attempt; "" for an unknown person.
        """
        place = address_of(request)
        self._throttle.failed(self._clock(), place_of(place), *names)
        found = self.control.directory.principals.get(person)
        name = found.name if found else ""
        self.recorder.sign_in_failed(way, place, str(error), name=name, principal=person)

    def succeeded(self, name: str) -> None:
        """Reset the count of failed attempts for a name."""
        self._throttle.succeeded(name)

    @asynccontextmanager
    async def hashing(self) -> AsyncIterator[None]:
        """Wait for a turn to hash a passphrase; raise `ApiError` 503 if too many attempts wait."""
        # Each attempt delays all later attempts, so a crowd is refused immediately.
        if self._waiting >= MOST_WAITING:
            raise ApiError(503, t("Too many people are signing in: try again."))
        self._waiting += 1
        try:
            async with self._hashes:
                yield
        finally:
            self._waiting -= 1

    async def open(
        self,
        request: Request,
        response: Response,
        person: Principal,
        way: Way,
        *,
        ends_at: float | None = None,
    ) -> Identity:
        """Open a sign-in for a person, and store its secret in the browser.

        Args:
            request: the request in which the person proved their identity.
            response: response to which the cookie is added.
            person: the person.
            way: the sign-in method.
            ends_at: UTC time at which the sign-in ends, in seconds since 1970; None for the usual
                time.

        Raises:
            AccessError: the person was removed, or has no role.
        """
        if not person.grants:
            raise AccessError(t("{name} has no role here: ask an administrator.", name=person.name))
        now = self.control.now()
        latest = PERSON.ends_at(now)
        ends = [one for one in (latest, ends_at) if one is not None]
        _, secret = await asyncio.to_thread(
            self.store.open_sign_in, person.id, way, now=now,
            ends_at=min(ends, default=None), idle_s=PERSON.idle_s,
            place=address_of(request), agent=agent_of(request),
        )  # fmt: skip
        # The previous sign-in ends last, so that the browser keeps it if opening the new sign-in
        # fails.
        await self._end_previous(request)
        return self.admit(request, response, secret)

    def admit(
        self, request: Request, response: Response, secret: str, *, is_device: bool = False
    ) -> Identity:
        """Store an open sign-in in the browser, and record the sign-in in the audit log.

        Args:
            request: the request.
            response: response to which the cookie is added.
            secret: the secret of the sign-in; the directory already contains the sign-in.
            is_device: whether the secret is a paired device's key, which remains after a sign-out.
        """
        who = self.control.identify(secret)
        is_secure = request.url.scheme == "https"
        for line in self.access.cookies(
            secret, request.scope["headers"], is_secure=is_secure, is_kept=True, is_device=is_device
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
        """End the browser's previous sign-in as a person and load the new sign-in."""
        before = visitor_of(request).identity
        if before.kind == "person" and before.way != "token":
            # The previous sign-in may already have ended.
            with suppress(AccessError):
                await self.control.end_sign_in(before.sign_in)
                return
        await self.control.reload()


def address_of(request: Request) -> str:
    """Return the network address of a request; "" if unknown."""
    return request.client.host if request.client else ""


def agent_of(request: Request) -> str:
    """Return a request's browser and operating system as text, such as “Chrome on Android”."""
    return browser_name(request.headers.get("user-agent", "")[:_LONGEST_AGENT])

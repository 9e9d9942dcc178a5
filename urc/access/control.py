"""Identifies the senders of requests to one server, and checks their rights at each command.

Layer 4. Each server has one local user in addition to the people, devices and programs in the
store. The local user holds the start key and administers the server. The server prints an address
that contains the start key. The start key and the local sign-ins exist only in memory and end with
the server.

Theory of operation. Every change, including a change by another process, replaces the whole
`directory`. The callbacks in `on_change` then close the sockets that have lost their rights. Time
in this module never runs backwards, so changing the machine's clock cannot revive an ended sign-in.
"""

import asyncio
import logging
import secrets
import time
from collections.abc import Callable, Collection
from hmac import compare_digest
from typing import Final

from urc.access.administration import end_sign_ins
from urc.access.directory import Directory, Identity, Principal, SignIn, Way, digest_of
from urc.access.grants import AccessError, Grant
from urc.access.store import AccessStore
from urc.access.visits import Visit, Visits
from urc.model.role import Role

__all__ = ["LOCAL_USER", "AccessControl"]

LOCAL_USER: Final = Principal("local", "person", "this computer", (Grant("administer"),))
"""The principal of the local user, who holds the start key."""
LOCAL_SIGN_INS: Final = 1000
"""Maximum number of sign-ins with the start key; above the limit, the oldest is closed."""
_CODES: Final = 16
WATCH_S: Final = 0.1
"""Interval between checks for changes by other processes, in seconds."""
TOUCH_S: Final = 60.0
"""Interval at which the last use of sign-ins is recorded, in seconds."""

log = logging.getLogger(__name__)


class AccessControl:
    """Identities and rights."""

    def __init__(
        self,
        store: AccessStore | None = None,
        *,
        key: str = "",
        instance: str = "",
        utc: Callable[[], float] = time.time,
    ) -> None:
        """Create the start key and load the store.

        Args:
            store: people, devices and programs; None for a server with only the local user.
            key: the start key; "" to generate one.
            instance: identifier of this server in cookie names; "" to generate one.
            utc: source of UTC time, in seconds since 1970.
        """
        self.store = store
        self.key = key or secrets.token_urlsafe(24)
        self.instance = instance or secrets.token_hex(4)
        self.on_change: list[Callable[[], None]] = []
        """Callbacks that run after each change of rights."""
        self._utc = utc
        self._latest = utc()
        self._codes: dict[str, None] = {}
        self._local: dict[str, SignIn] = {}
        self._visits = Visits()
        program = self._sign_in("token", digest_of(self.key))
        self._program = program
        self.directory = Directory()
        self._used: dict[str, float] = {}
        """UTC time of the last use that the store does not contain yet, by sign-in id."""
        self.load()

    # Identities

    def now(self) -> float:
        """Return UTC time in seconds, never earlier than the previous result."""
        self._latest = max(self._latest, self._utc())
        return self._latest

    def identify(self, secret: str) -> Identity:
        """Return the identity with this sign-in secret or token; `NOBODY` if there is no match."""
        return self.directory.identify(secret, self.now())

    def role(self, who: Identity, robot: str = "", tags: Collection[str] = ()) -> Role | None:
        """Return the current role of `who` for a robot; if `robot` is "", for the whole server."""
        return self.directory.role(who, self.now(), robot, tags)

    # The local user

    def code(self) -> str:
        """Return a one-time code that replaces the start key for one browser of the local user.

        A used code can be disclosed safely, for example in a browser's command line.
        """
        code = secrets.token_urlsafe(24)
        self._codes[code] = None
        while len(self._codes) > _CODES:
            self._codes.pop(next(iter(self._codes)))
        return code

    def admit(self, word: str, *, place: str = "", agent: str = "") -> str | None:
        """Open a sign-in with the start key or a code; return its secret, or None on failure."""
        if word in self._codes:
            del self._codes[word]
        elif not compare_digest(word.encode(), self.key.encode()):
            return None
        secret = secrets.token_urlsafe(32)
        sign_in = self._sign_in("key", digest_of(secret))
        self._local[sign_in.id] = sign_in._replace(place=place, agent=agent)
        while len(self._local) > LOCAL_SIGN_INS:
            self._local.pop(next(iter(self._local)))
        self._merge()
        return secret

    def best_role(self, who: Identity) -> Role | None:
        """Return the highest current role of `who` for any robot; None if `who` has no role."""
        return self.directory.best_role(who, self.now())

    # Visitors from other sites

    def visit(self, visit: Visit, lasts_s: float) -> Identity:
        """Admit a visitor from another site, or prolong the visit; return the identity."""
        now = self.now()
        who, is_changed = self._visits.renew(visit, now, now + lasts_s)
        if is_changed:
            self._merge()
        return who

    def judge_visits(self, judged: Callable[[Visit], Visit]) -> list[Visit]:
        """Replace each visit by `judged` of it; return the visits that have changed."""
        changed = self._visits.judge(judged)
        if changed:
            self._merge()
        return changed

    def visit_limit(self, who: Identity, robot: str) -> str:
        """Return why a visitor's role for a robot is lower than proposed; "" if it is not."""
        return self._visits.limit(who.sign_in, robot) if who.way == "site" else ""

    def end_visits(self, site: str) -> None:
        """End all visits from a site, for example because its certificate was revoked."""
        if self._visits.end_site(site):
            self._merge()

    # Changes

    async def watch(self) -> None:
        """Until cancelled, detect changes by other processes and record the use of sign-ins.

        A thread reads the file, because another process may have locked it. Waking a thread costs
        more than looking at the file's time, so this comes first.
        """
        touched_at = self.now()
        while self.store is not None:
            await asyncio.sleep(WATCH_S)
            if self._visits.end(self.now()):
                self._merge()
            try:
                if self.store.may_have_changed() and await asyncio.to_thread(self.store.changed):
                    await self.reload()
                if self.now() - touched_at >= TOUCH_S:
                    touched_at = self.now()
                    await self._record_use()
                if self.now() >= self._next_end:
                    await self._end_overdue()
            except AccessError as error:
                log.warning("%s", error)

    async def reload(self) -> None:
        """Read the store again, and run the callbacks in `on_change`."""
        if self.store is not None:
            self._stored = await asyncio.to_thread(self.store.directory)
        self._merge()

    def load(self) -> None:
        """Read the store again, like `reload`, but block until the read is complete."""
        self._stored = self.store.directory() if self.store else Directory()
        self._merge()

    async def end_sign_in(self, sign_in: str) -> None:
        """End a sign-in of any kind; raise `AccessError` if the sign-in is unknown."""
        if self._local.pop(sign_in, None) is None and self.store is not None:
            await asyncio.to_thread(self.store.close_sign_in, sign_in)
        await self.reload()

    def used(self, sign_in: str) -> None:
        """Note that a sign-in was used; `watch` records the use later."""
        # Note the use only in memory: every request is a use, and a transaction would wait for the
        # disk.
        self._used[sign_in] = self.now()

    async def _record_use(self) -> None:
        used, self._used = self._used, {}  # later uses are recorded next time
        if used and self.store is not None:
            await asyncio.to_thread(self.store.touch_all, used)
            await self.reload()

    async def _end_overdue(self) -> None:
        """Delete expired sign-ins and report the change.

        The sockets of these sign-ins are closed. If the clock is set back before the next start,
        the deleted sign-ins stay invalid.
        """
        # Record the uses in memory first, so that an active sign-in does not expire as idle.
        await self._record_use()
        if self.store is not None:
            now, directory = self.now(), self._stored
            await asyncio.to_thread(
                end_sign_ins, self.store, lambda one, _: directory.end_of(one) <= now
            )
            await self.reload()

    def _merge(self) -> None:
        ends = map(self._stored.end_of, self._stored.sign_ins.values())
        self._next_end = min(ends, default=float("inf"))
        own = {self._program.id: self._program, **self._local, **self._visits.sign_ins}
        sign_ins = {**self._stored.sign_ins, **own}
        # Use a single assignment, so that no request sees a partial change. The callbacks run
        # afterwards, because each socket checks its rights in the new directory.
        self.directory = Directory(
            {**self._stored.principals, **self._visits.principals, LOCAL_USER.id: LOCAL_USER},
            sign_ins,
            {one.digest: one.id for one in sign_ins.values() if one.way != "site"},
        )
        for report in self.on_change:
            report()

    def _sign_in(self, way: Way, digest: bytes) -> SignIn:
        now = self._utc()
        return SignIn(secrets.token_hex(8), LOCAL_USER.id, way, digest, now, now, None, None)

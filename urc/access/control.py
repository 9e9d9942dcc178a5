"""The access control of one server: it identifies requests, and reads rights at each command.

Layer 4. Each server has one local user besides the people, devices and programs of the store. The
local user holds the start key, which the server prints in its address, and administers. The start
key and the local sign-ins are in memory only, and end with the server.

Theory of operation. Each change replaces `directory` as a whole, including changes by another
process. Then `on_change` is called, and sockets without a right are closed. The time of this module
never runs backwards, so a machine with a wrong clock cannot revive an ended sign-in.
"""

import secrets
import time
from collections.abc import Callable, Collection
from hmac import compare_digest
from typing import Final

from urc.access.directory import Directory, Identity, Principal, SignIn, Way, digest_of
from urc.access.grants import Grant
from urc.access.store import AccessStore
from urc.model.role import Role

__all__ = ["LOCAL_USER", "AccessControl"]

LOCAL_USER: Final = Principal("local", "person", "this computer", (Grant("administer"),))
"""The holder of the start key."""
LOCAL_SIGN_INS: Final = 1000
"""Most browsers and programs with the start key; the oldest sign-in is closed for a new one."""
_CODES: Final = 16


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
        """Make the start key.

        Args:
            store: people, devices and programs; None for a server with the local user alone.
            key: the start key; "" makes one.
            instance: identifier of this server in cookie names; "" makes one.
            utc: source of UTC time, in seconds since 1970.
        """
        self.store = store
        self.key = key or secrets.token_urlsafe(24)
        self.instance = instance or secrets.token_hex(4)
        self.on_change: list[Callable[[], None]] = []
        """Called after each change of rights."""
        self._utc = utc
        self._latest = utc()
        self._codes: dict[str, None] = {}
        self._local: dict[str, SignIn] = {}
        program = self._sign_in("token", digest_of(self.key))
        self._program = program
        self.directory = Directory()
        self.reload()

    # Identities

    def now(self) -> float:
        """Return UTC time in seconds, never earlier than before."""
        self._latest = max(self._latest, self._utc())
        return self._latest

    def identify(self, secret: str) -> Identity:
        """Return the identity that holds a sign-in's secret or a token; `NOBODY` without one."""
        return self.directory.identify(secret, self.now())

    def role(self, who: Identity, robot: str = "", tags: Collection[str] = ()) -> Role | None:
        """Return the present role of `who` at a robot; "" asks for the whole server."""
        return self.directory.role(who, self.now(), robot, tags)

    # The local user

    def code(self) -> str:
        """Return a code for one browser of the local user, in place of the start key.

        The code may appear in public after its use, for example in the command line of a browser.
        """
        code = secrets.token_urlsafe(24)
        self._codes[code] = None
        while len(self._codes) > _CODES:
            self._codes.pop(next(iter(self._codes)))
        return code

    def admit(self, word: str, *, place: str = "", agent: str = "") -> str | None:
        """Return the secret of a new sign-in for the start key or a code; None for other words."""
        if word in self._codes:
            del self._codes[word]
        elif not compare_digest(word.encode(), self.key.encode()):
            return None
        secret = secrets.token_urlsafe(32)
        sign_in = self._sign_in("link", digest_of(secret))
        self._local[sign_in.id] = sign_in._replace(place=place, agent=agent)
        while len(self._local) > LOCAL_SIGN_INS:
            self._local.pop(next(iter(self._local)))
        self.reload()
        return secret

    # Changes

    def reload(self) -> None:
        """Read the store again, and report the change."""
        kept = self.store.directory() if self.store else Directory()
        own = {self._program.id: self._program, **self._local}
        sign_ins = {**kept.sign_ins, **own}
        self.directory = Directory(
            {**kept.principals, LOCAL_USER.id: LOCAL_USER},
            sign_ins,
            {sign_in.digest: sign_in.id for sign_in in sign_ins.values()},
        )
        for report in self.on_change:
            report()

    def poll(self) -> bool:
        """Reload after a change by another process; return whether there was one."""
        is_changed = self.store is not None and self.store.changed()
        if is_changed:
            self.reload()
        return is_changed

    def close_sign_in(self, sign_in: str) -> None:
        """Close any sign-in; raise `AccessError` if it is unknown."""
        if self._local.pop(sign_in, None) is None and self.store is not None:
            self.store.close_sign_in(sign_in)
        self.reload()

    def _sign_in(self, way: Way, digest: bytes) -> SignIn:
        now = self._utc()
        return SignIn(secrets.token_hex(8), LOCAL_USER.id, way, digest, now, now, None, None)

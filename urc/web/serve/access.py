"""Access over HTTP: the identity of each request, from its cookie or its token, never its address.

Layer 5. The address printed by URC contains the start key. A browser sends the key once, and gets a
sign-in in a cookie that scripts cannot read. Signed-in people and guests have a second cookie,
which is valid after a restart. A paired device has a third one, which stays when its operator signs
out. A program sends its token with each request.
"""

import asyncio
import secrets
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from math import inf
from typing import Final
from urllib.parse import quote

from urc.access.control import LOCAL_USER, AccessControl
from urc.access.directory import NOBODY, Identity
from urc.model.role import Role
from urc.web.serve.visitor import Visitor

__all__ = ["PARAMETER", "Access"]

PARAMETER: Final = "key"
"""Name of the query parameter that carries the start key."""
START: Final = "urc-start-"
"""Start of the name of the cookie of the local user."""
SIGN_IN: Final = "urc-sign-in-"
"""Start of the name of the cookie of people and guests."""
DEVICE: Final = "urc-device-"
"""Start of the name of the cookie of a paired device."""
SECURE: Final = "__Host-"
"""Start of the names of all cookies over TLS (RFC 6265bis, 4.1.3.2)."""
OLD_COOKIES: Final = 8
"""Maximum number of cookies from earlier starts in one browser; beyond this number, all such
cookies are deleted."""
COOKIE_S: Final = 400 * 24 * 3600
"""Lifetime of the cookie of a sign-in, in seconds; the server decides when the sign-in ends."""
CLOCK_S: Final = 60.0
"""Time between two checks of the clock, in seconds."""
_Headers = Iterable[tuple[bytes, bytes]]


class Access:
    """The identities of one server's requests, and the sockets that depend on their rights."""

    def __init__(
        self,
        control: AccessControl | None = None,
        *,
        anonymous: Role | None = None,
        key: str = "",
        instance: str = "",
    ) -> None:
        """Prepare.

        Args:
            control: identities and rights; None for the local user alone.
            anonymous: role of visitors without a sign-in; None: they may only press STOP.
            key: the start key of a server without `control`; "" to generate a key.
            instance: identifier of this start in the cookie's name; "" to generate an identifier.
        """
        self.control = control or AccessControl(key=key)
        self.anonymous = anonymous
        self.instance = instance or secrets.token_hex(4)
        self.cookie = START + self.instance
        store = self.control.store
        self.sign_in_cookie = SIGN_IN + (store.instance() if store else self.instance)
        """Name of the cookie of people and guests, without the prefix for TLS."""
        self.device_cookie = DEVICE + self.sign_in_cookie.removeprefix(SIGN_IN)
        """Name of the cookie of a paired device, without the prefix for TLS."""
        self.frame_code = f"/frame-code/{secrets.token_urlsafe(16)}"
        """Secret path prefix of code for frames; needed because a frame has no origin and therefore
        sends no cookies."""
        self.tags_of: Callable[[str], Collection[str]] = _untagged
        """Function that returns the tags of a robot."""
        self.on_admit: Callable[[Identity, str, str], None] = _unrecorded
        """Callback for each use of a start key or code: the new identity, or `NOBODY` for a wrong
        key; the network address; the browser."""
        self.on_bad_token: Callable[[str], None] = _unheard
        self.clock_check: Callable[[], str] = _right_clock
        """Function that returns a warning about a wrong clock, or ""; it may block."""
        self.clock_warning = ""
        """The last result of `clock_check`, which each page shows."""
        """Callback for each request with a token that is unknown, over or revoked, with the network
        address."""
        self._dependents: set[Callable[[], None]] = set()
        self.control.on_change.append(self.recheck)

    # Addresses

    @property
    def key(self) -> str:
        """The start key."""
        return self.control.key

    def address(self, url: str) -> str:
        """Return `url` with the start key; `url` must not have a query."""
        return f"{url}?{PARAMETER}={quote(self.key, safe='')}"

    def address_once(self, url: str) -> str:
        """Return an address without the start key that admits only the first browser.

        The address may become visible to others, for example in the command line of a browser.
        """
        return f"{url}?{PARAMETER}={self.control.code()}"

    # Identities

    def visitor(self, headers: _Headers, *, is_secure: bool = False) -> Visitor:
        """Return the visitor of a request.

        Args:
            headers: headers of the request, with names in lower case.
            is_secure: whether the request came over TLS. Then only cookies with `SECURE` count:
                other servers under the same host name cannot set them.
        """
        pairs = list(headers)
        for name, value in pairs:
            scheme, _, word = value.decode("latin-1").partition(" ")
            if name == b"authorization" and scheme.lower() == "bearer":
                who = self.control.identify(word.strip())
                is_token = who.way == "token"  # a cookie's secret is not a token
                return Visitor(self, self._seen(who) if is_token else NOBODY, is_program=True)
        known = list(_cookies(pairs))
        found = (
            self._holder(known, SECURE + one if is_secure else one)
            for one in (self.cookie, self.sign_in_cookie, self.device_cookie)
        )
        return Visitor(self, self._seen(next((who for who in found if who != NOBODY), NOBODY)))

    def _holder(self, cookies: Iterable[tuple[str, str]], name: str) -> Identity:
        """Return the identity of the cookies with a name; or `NOBODY`.

        Programs on other ports of a machine may set cookies of the same name: all are tried.
        """
        for stored, secret in cookies:
            if stored == name:
                who = self.control.identify(secret)
                if who != NOBODY and who.way != "token":
                    return who
        return NOBODY

    def _seen(self, who: Identity) -> Identity:
        if who != NOBODY and not self._is_own(who):
            self.control.used(who.sign_in)
        return who

    def admit(self, word: str, *, place: str = "", agent: str = "") -> str | None:
        """Return the secret of a new sign-in of the local user for the start key or a code."""
        secret = self.control.admit(word, place=place, agent=agent)
        self.on_admit(self.control.identify(secret) if secret else NOBODY, place, agent)
        return secret

    def cookies(
        self,
        secret: str,
        headers: _Headers,
        *,
        is_secure: bool,
        is_kept: bool = False,
        is_device: bool = False,
    ) -> list[str]:
        """Return the ``Set-Cookie`` headers that store a sign-in in the browser.

        Args:
            secret: the secret of the sign-in.
            headers: headers of the request.
            is_secure: whether the request came over TLS.
            is_kept: whether the sign-in remains valid after a restart; it replaces the cookie of
                the local user.
            is_device: whether it is the key of a paired device, which stays after a sign-out.
        """
        how = _attributes(is_secure=is_secure)
        before = SECURE if is_secure else ""
        known = {name for name, _ in _cookies(headers)}
        if is_kept:
            name = self.device_cookie if is_device else self.sign_in_cookie
            kept = [f"{before}{name}={secret}; Max-Age={COOKIE_S}; {how}"]
            return kept + _deleted(known & {self.cookie, SECURE + self.cookie})
        kept = [f"{before}{self.cookie}={secret}; {how}"]
        old = {one for one in known if one.removeprefix(SECURE).startswith(START)}
        old -= {self.cookie, SECURE + self.cookie}
        return kept + (_deleted(old) if len(old) > OLD_COOKIES else [])

    def forgotten(self, headers: _Headers, *, is_device: bool = False) -> list[str]:
        """Return the ``Set-Cookie`` headers that delete the sign-ins of a browser.

        Args:
            headers: headers of the request.
            is_device: whether to delete the key of the paired device, too.
        """
        ours = {self.cookie, self.sign_in_cookie, *([self.device_cookie] if is_device else [])}
        return _deleted({one for one, _ in _cookies(headers) if one.removeprefix(SECURE) in ours})

    # Rights

    def role(self, who: Identity, robot: str = "") -> Role | None:
        """Return the present role of `who` at a robot; "" asks for the whole server."""
        tags = self.tags_of(robot) if robot else ()
        return self.control.role(who, robot, tags) or self.anonymous

    def best_role(self, who: Identity) -> Role | None:
        """Return the highest present role of `who` at any robot."""
        return self.control.best_role(who) or self.anonymous

    def may_give(self, who: Identity, command: str) -> bool:
        """Return whether the scope of a token contains a command; a command is a use."""
        return self.control.directory.may_give(self._seen(who), command)

    def signed_in_s(self, who: Identity) -> float:
        """Return the time since the sign-in of `who`, in seconds; infinite without a sign-in."""
        sign_in = self.control.directory.sign_ins.get(who.sign_in)
        return self.control.now() - sign_in.created_at if sign_in else inf

    def is_local(self, who: Identity) -> bool:
        """Return whether `who` is the local user, with a sign-in that has not ended."""
        return self._is_own(who) and self.control.role(who) is not None

    def _is_own(self, who: Identity) -> bool:
        return who.principal == LOCAL_USER.id

    # Sockets

    async def run(self) -> None:
        """Follow changes by other processes, ends of sign-ins and the clock, until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self.control.watch())
            group.create_task(self._watch_clock())

    async def _watch_clock(self) -> None:
        """Check the clock now and each minute: a network may set it at any time."""
        while True:
            self.clock_warning = await asyncio.to_thread(self.clock_check)
            await asyncio.sleep(CLOCK_S)

    @contextmanager
    def followed(self, recheck: Callable[[], None]) -> Iterator[None]:
        """Call `recheck` after each change of rights while the context is open."""
        self._dependents.add(recheck)
        try:
            yield
        finally:
            self._dependents.discard(recheck)

    def recheck(self) -> None:
        """Let all sockets and streams look at their rights again."""
        for recheck in tuple(self._dependents):
            recheck()


def _attributes(*, is_secure: bool) -> str:
    return "Path=/; HttpOnly; SameSite=Strict" + ("; Secure" if is_secure else "")


def _deleted(names: Iterable[str]) -> list[str]:
    return [
        f"{name}=; Max-Age=0; {_attributes(is_secure=name.startswith(SECURE))}"
        for name in sorted(names)
    ]


def _unrecorded(who: Identity, place: str, agent: str) -> None:
    """Ignore the use of a start key, because this server has no audit log."""


def _unheard(place: str) -> None:
    """Ignore a bad token, because this server has no audit log."""


def _right_clock() -> str:
    """Return "", because nothing is known about the clock."""
    return ""


def _untagged(_: str) -> Collection[str]:
    return ()


def _cookies(headers: _Headers) -> Iterator[tuple[str, str]]:
    """Yield the name and value of each cookie; names may repeat."""
    for name, value in headers:
        if name == b"cookie":
            for part in value.decode("latin-1").split(";"):
                # Only spaces of ASCII: the filter of proxies must find the same names.
                key, _, word = part.strip(" \t").partition("=")
                yield key, word

"""Access over HTTP: a request's identity comes from its cookie or token, never from its address.

Layer 5. The address printed by URC contains the start key. A browser sends the key once and
receives a sign-in in a cookie that scripts cannot read. Signed-in people and guests have a second
cookie, which stays valid after a restart. A paired device has a third cookie, which remains when
its operator signs out. A program sends its token with each request.
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
from urc.access.visits import Visit
from urc.fleet.assertion import LASTS_S, SCHEME
from urc.model.role import Role
from urc.problems import UrcError
from urc.web.serve.site_peer import SitePeer
from urc.web.serve.visitor import Visitor

__all__ = ["PARAMETER", "Access"]

PARAMETER: Final = "key"
"""Query parameter that contains the start key."""
START: Final = "urc-start-"
"""Prefix of the cookie name for the local user."""
SIGN_IN: Final = "urc-sign-in-"
"""Prefix of the cookie name for people and guests."""
DEVICE: Final = "urc-device-"
"""Prefix of the cookie name for paired devices."""
SECURE: Final = "__Host-"
"""Prefix of all cookie names over TLS (RFC 6265bis, 4.1.3.2)."""
OLD_COOKIES: Final = 8
"""Maximum number of cookies from earlier server starts in one browser. Above the limit, all such
cookies are deleted."""
COOKIE_S: Final = 400 * 24 * 3600
"""Lifetime of sign-in cookies, in seconds; the sign-in itself may end earlier."""
CLOCK_S: Final = 60.0
"""Interval between checks of the clock, in seconds."""
_Headers = Iterable[tuple[bytes, bytes]]


class Access:
    """Identifies the sender of each request, and notifies sockets of changed rights."""

    def __init__(
        self,
        control: AccessControl | None = None,
        *,
        anonymous: Role | None = None,
        key: str = "",
        instance: str = "",
    ) -> None:
        """Create the access control for the requests to one server.

        Args:
            control: identities and rights; None creates a control with only the local user.
            anonymous: role of visitors who have not signed in; None permits them only to press
                STOP.
            key: the start key of a server without `control`; "" to generate a key.
            instance: identifier of this server start, used in cookie names; "" to generate an
                identifier.
        """
        self.control = control or AccessControl(key=key)
        self.anonymous = anonymous
        self.instance = instance or secrets.token_hex(4)
        self.cookie = START + self.instance
        store = self.control.store
        self.sign_in_cookie = SIGN_IN + (store.instance() if store else self.instance)
        """Cookie name for people and guests, without the TLS prefix."""
        self.device_cookie = DEVICE + self.sign_in_cookie.removeprefix(SIGN_IN)
        """Cookie name for paired devices, without the TLS prefix."""
        self.frame_code = f"/frame-code/{secrets.token_urlsafe(16)}"
        """Secret path prefix of the frames' code. Frames have no origin and therefore send no
        cookies."""
        self.tags_of: Callable[[str], Collection[str]] = _untagged
        """Function that returns a robot's tags."""
        self.on_admit: Callable[[Identity, str, str], None] = _unrecorded
        """Callback for each use of a start key or code. The callback's arguments are the new
        identity (`NOBODY` for a wrong key), the network address and the browser."""
        self.on_bad_token: Callable[[str], None] = _unheard
        """Callback for each request with an unknown, expired or revoked token. The callback's
        argument is the network address."""
        self.site_visitor: Callable[[SitePeer, str], Visit] = _no_visitors
        """Function that returns the visit in an assertion of another site. The arguments are the
        site and the assertion. It raises `UrcError` for an assertion that does not count. A visit
        without a role is refused."""
        self.clock_check: Callable[[], str] = _right_clock
        """Function that returns a warning about a wrong clock; "" for a correct clock. It may
        block."""
        self.clock_warning = ""
        """Latest result of `clock_check`, which every page shows."""
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
        """Return an address with a single-use code in place of the start key.

        Other users may see the address, for example in a browser's command line.
        """
        return f"{url}?{PARAMETER}={self.control.code()}"

    # Identities

    def visitor(self, headers: _Headers, *, is_secure: bool = False) -> Visitor:
        """Return the visitor of a request.

        Args:
            headers: headers of the request, with names in lower case.
            is_secure: whether the request came over TLS. If true, only cookies whose names begin
                with `SECURE` count, because other servers under the same host name cannot set them.
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

    def visitor_from(self, peer: SitePeer, headers: _Headers, path: str) -> tuple[Visitor, str]:
        """Return the visitor of a request from another site, and why the request is refused.

        Args:
            peer: the site, as proven by its certificate.
            headers: headers of the request, with names in lower case. Without an assertion, the
                visitor is unknown and may only press STOP.
            path: path of the request.
        """
        if peer.is_invitation:  # nobody acts from there
            return Visitor(self, NOBODY, is_program=True), peer.refusal(path)
        for name, value in headers:
            scheme, _, text = value.decode("latin-1").partition(" ")
            if name == b"authorization" and scheme.lower() == SCHEME.lower():
                try:
                    visit = self.site_visitor(peer, text.strip())
                except UrcError as fault:
                    return Visitor(self, NOBODY, is_program=True), str(fault)
                who = self.control.visit(visit, LASTS_S)
                if visit.role is None:
                    return Visitor(self, NOBODY, is_program=True), visit.limit
                return Visitor(self, who, is_program=True), ""
        return Visitor(self, NOBODY, is_program=True), ""

    def _holder(self, cookies: Iterable[tuple[str, str]], name: str) -> Identity:
        """Return the identity from the cookies with a given name, or `NOBODY`.

        All cookies with the name are tried, because programs on other ports of the same host can
        set cookies with this name.
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
        """Return the secret of a new local user sign-in; None for a wrong start key or code."""
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
            is_kept: whether the sign-in remains valid after a restart; its cookie replaces the
                local user's cookie.
            is_device: whether the secret is a paired device's key, which remains after a sign-out.
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
        """Return the ``Set-Cookie`` headers that delete a browser's sign-ins.

        Args:
            headers: headers of the request.
            is_device: whether to delete the paired device's key as well.
        """
        ours = {self.cookie, self.sign_in_cookie, *([self.device_cookie] if is_device else [])}
        return _deleted({one for one, _ in _cookies(headers) if one.removeprefix(SECURE) in ours})

    # Rights

    def role(self, who: Identity, robot: str = "") -> Role | None:
        """Return the current role of `who` for a robot; "" stands for the whole server."""
        tags = self.tags_of(robot) if robot else ()
        role = self.control.role(who, robot, tags)
        return role if who.way == "site" else role or self.anonymous

    def best_role(self, who: Identity) -> Role | None:
        """Return the highest current role of `who` for any robot."""
        role = self.control.best_role(who)
        return role if who.way == "site" else role or self.anonymous

    def may_give(self, who: Identity, command: str) -> bool:
        """Return whether a token permits a command; record the use of the token."""
        return self.control.directory.may_give(self._seen(who), command)

    def limit(self, who: Identity, robot: str) -> str:
        """Return why the role of `who` for a robot is limited, as one line; "" if it is not."""
        return self.control.visit_limit(who, robot)

    def signed_in_s(self, who: Identity) -> float:
        """Return the time since `who` signed in, in seconds; infinite without a sign-in."""
        sign_in = self.control.directory.sign_ins.get(who.sign_in)
        return self.control.now() - sign_in.created_at if sign_in else inf

    def is_local(self, who: Identity) -> bool:
        """Return whether `who` is the local user with a valid sign-in."""
        return self._is_own(who) and self.control.role(who) is not None

    def _is_own(self, who: Identity) -> bool:
        return who.principal == LOCAL_USER.id

    # Sockets

    async def run(self) -> None:
        """Watch for changes by other processes, expired sign-ins and clock errors."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self.control.watch())
            group.create_task(self._watch_clock())

    async def _watch_clock(self) -> None:
        """Check the clock now and every minute, because a time service may set it later."""
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
        """Make all sockets and streams check their rights again."""
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
    """Ignore an invalid token, because this server has no audit log."""


def _no_visitors(peer: SitePeer, text: str) -> Visit:
    """Refuse all visitors, because this server belongs to no fleet."""
    raise UrcError("this server belongs to no fleet")


def _right_clock() -> str:
    """Return "" for no warning, because no clock check is configured."""
    return ""


def _untagged(_: str) -> Collection[str]:
    return ()


def _cookies(headers: _Headers) -> Iterator[tuple[str, str]]:
    """Yield each cookie's name and value; a name can occur more than once."""
    for name, value in headers:
        if name == b"cookie":
            for part in value.decode("latin-1").split(";"):
                # Strip only ASCII spaces, because the proxy filter must find the same names.
                key, _, word = part.strip(" \t").partition("=")
                yield key, word

"""Identity of visitors. The proof is a secret that changes at each start, never an address.

Layer 5. Pure. The address printed by URC contains the start key. A browser sends the key once, and
gets a session in a cookie that scripts cannot read. A program sends the key with each request. Keys
and sessions expire when the server stops.
"""

import secrets
from collections.abc import Iterable, Iterator
from hmac import compare_digest
from typing import Literal, NamedTuple
from urllib.parse import quote

__all__ = ["PARAMETER", "UNKNOWN_VISITOR", "Access", "Standing", "Visitor"]

PARAMETER = "key"
"""Name of the query parameter that carries the start key."""
PREFIX = "urc-start-"
SESSIONS = 1000
"""Maximum number of known browsers; beyond this number, the oldest browser is forgotten."""
CODES = 16
OLD_COOKIES = 8
"""Maximum number of cookies from earlier starts in one browser; beyond this number, all such
cookies are deleted."""

Standing = Literal["here", "manager", "stranger"]
"""Rights of a visitor: ``here`` has the start key, ``manager`` the token of ``--manage``,
``stranger`` neither."""
_Headers = Iterable[tuple[bytes, bytes]]


class Visitor(NamedTuple):
    """Identity of a visitor."""

    standing: Standing = "stranger"
    name: str = ""
    """Identifier of the browser or program; "" for an unknown visitor. No secret."""
    is_program: bool = False
    """Whether the request carries the key; a page of another site cannot send such a request."""


UNKNOWN_VISITOR = Visitor()


class Access:
    """The keys of one start of the server, and the browsers that these keys have admitted."""

    def __init__(
        self, *, is_open: bool = False, key: str = "", instance: str = "", token: str = ""
    ) -> None:
        """Make the key.

        Args:
            is_open: whether unknown visitors may watch and drive; if false, they may only press
                STOP.
            key: the start key; "" to generate a key.
            instance: identifier of this start in the cookie's name; "" to generate an identifier.
            token: the secret of managers; "" for no managers.
        """
        self.is_open = is_open
        self.key = key or secrets.token_urlsafe(24)
        self.instance = instance or secrets.token_hex(4)
        self.cookie = PREFIX + self.instance
        self.frame_code = f"/frame-code/{secrets.token_urlsafe(16)}"
        """Secret path prefix of code for frames; needed because a frame has no origin and therefore
        sends no cookies."""
        self._token = token
        self._sessions: dict[str, Visitor] = {}
        self._codes: dict[str, None] = {}
        self._count = 0

    def address(self, url: str) -> str:
        """Return `url` with the start key; `url` must not have a query."""
        return f"{url}?{PARAMETER}={quote(self.key, safe='')}"

    def address_once(self, url: str) -> str:
        """Return an address without the start key that admits only the first browser.

        The address may become visible to others, for example in the command line of a browser.
        """
        code = secrets.token_urlsafe(24)
        self._codes[code] = None
        while len(self._codes) > CODES:
            self._codes.pop(next(iter(self._codes)))
        return f"{url}?{PARAMETER}={code}"

    def address_of_managers(self, url: str) -> str:
        """Return the address for remote managers; "" without a manager token."""
        return f"{url}?{PARAMETER}={quote(self._token, safe='')}" if self._token else ""

    def admit(self, word: str) -> str | None:
        """Return a new session for a browser that has sent the key `word`; None for a wrong key."""
        standing = self._standing(word)
        if standing is None and word in self._codes:
            del self._codes[word]
            standing = "here"
        if standing is None:
            return None
        self._count += 1
        session = secrets.token_urlsafe(24)
        self._sessions[session] = Visitor(standing, f"browser {self._count}")
        while len(self._sessions) > SESSIONS:
            self._sessions.pop(next(iter(self._sessions)))
        return session

    def cookies(self, session: str, headers: _Headers, *, is_secure: bool) -> list[str]:
        """Return the ``Set-Cookie`` headers that store a session in the browser.

        Args:
            session: a result of `admit`.
            headers: headers of the request.
            is_secure: whether the request came over TLS.
        """
        secure = "; Secure" if is_secure else ""
        kept = [f"{self.cookie}={session}; Path=/; HttpOnly; SameSite=Strict{secure}"]
        old = {name for name, _ in _cookies(headers) if name.startswith(PREFIX)} - {self.cookie}
        if len(old) > OLD_COOKIES:
            kept += (f"{name}=; Path=/; Max-Age=0; HttpOnly; SameSite=Strict" for name in old)
        return kept

    def visitor(self, headers: _Headers) -> Visitor:
        """Return the visitor of a request from its headers, with names in lower case."""
        pairs = list(headers)
        for name, value in pairs:
            scheme, _, word = value.decode("latin-1").partition(" ")
            if name == b"authorization" and scheme.lower() == "bearer":
                standing = self._standing(word.strip())
                return (
                    Visitor(standing, f"program {standing}", True) if standing else UNKNOWN_VISITOR
                )
        for cookie, session in _cookies(pairs):
            if cookie == self.cookie and session in self._sessions:
                return self._sessions[session]
        return UNKNOWN_VISITOR

    def _standing(self, word: str) -> Standing | None:
        if _is_same(word, self.key):
            return "here"
        return "manager" if self._token and _is_same(word, self._token) else None


def _is_same(said: str, wanted: str) -> bool:
    return compare_digest(said.encode(), wanted.encode())


def _cookies(headers: _Headers) -> Iterator[tuple[str, str]]:
    """Yield the name and value of each cookie; names may repeat."""
    for name, value in headers:
        if name == b"cookie":
            for part in value.decode("latin-1").split(";"):
                key, _, word = part.strip().partition("=")
                yield key, word

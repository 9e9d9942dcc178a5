"""Options that `http` and `websocket` share: URL, TLS, credentials and headers.

The server is fixed when the transport is created, so a robot's response cannot redirect requests
elsewhere.
"""

import re
from base64 import b64encode
from collections.abc import Iterable, Mapping
from typing import NamedTuple
from urllib.parse import urlsplit

from urc._headers import is_reserved
from urc.transports._faults import place_of
from urc.transports._tls import Tls
from urc.transports.base import TransportError

__all__ = ["Credentials", "OptionReader", "WebOrigin"]

MAX_HEADERS = 32
"""Maximum number of headers that a document may add to each request."""


class WebOrigin(NamedTuple):
    """The scheme, host, port and path of a URL."""

    is_secure: bool
    host: str
    port: int
    path: str
    """Path with a leading slash, followed by the query if present."""

    @property
    def authority(self) -> str:
        """Host and port in the notation of the Host header."""
        return place_of(self.host, self.port)


class OptionReader:
    """Reads one transport's options; an invalid option raises a one-line error."""

    def __init__(self, kind: str, options: Mapping[str, object]) -> None:
        """Read the `options` of a transport of type `kind`."""
        self.kind = kind
        self._options = options

    def part(self, name: str) -> "OptionReader":
        """Return a reader of the mapping option `name`, or an empty reader for a missing option."""
        found = self._options.get(name)
        if found is None:
            return OptionReader(self.kind, {})
        if not isinstance(found, Mapping):
            raise TransportError(f"{self.kind}: {name} must be a mapping, not {found!r}")
        return OptionReader(self.kind, found)

    def entries(self) -> Iterable[tuple[str, object]]:
        """Return all options as pairs of name and value."""
        return self._options.items()

    def tokens(self, name: str) -> list[str]:
        """Return an option that is a list of HTTP tokens."""
        found = self._options.get(name) or []
        if not isinstance(found, list | tuple) or not all(
            isinstance(one, str) and _TOKEN.fullmatch(one) for one in found
        ):
            raise TransportError(f"{self.kind}: {name} must be a list of names, not {found!r}")
        return list(found)

    def text(self, name: str, default: str = "") -> str:
        """Return a text option without surrounding spaces."""
        found = self._options.get(name, default)
        if found is None:
            return default
        if not isinstance(found, str):
            raise TransportError(f"{self.kind}: {name} must be text, not {found!r}")
        return found.strip()

    def choice(self, name: str, choices: tuple[str, ...], default: str) -> str:
        """Return an option whose value is one of `choices`."""
        found = self.text(name, default)
        if found not in choices:
            words = f"{', '.join(choices[:-1])} or {choices[-1]}"
            raise TransportError(f"{self.kind}: {name} must be {words}, not {found!r}")
        return found

    def flag(self, name: str, default: bool) -> bool:
        """Return a boolean option."""
        found = self._options.get(name, default)
        if not isinstance(found, bool):
            raise TransportError(f"{self.kind}: {name} must be true or false, not {found!r}")
        return found

    def number(self, name: str, default: float, least: float, most: float) -> float:
        """Return a number option; its value must be from `least` to `most`."""
        found = self._options.get(name, default)
        if isinstance(found, bool) or not isinstance(found, int | float):
            raise TransportError(f"{self.kind}: {name} must be a number, not {found!r}")
        if not least <= found <= most:
            span = f"from {least:g} to {most:g}"
            raise TransportError(f"{self.kind}: {name} must be {span}, not {found!r}")
        return found

    def duration(self, name: str, default_s: float, least_s: float, most_s: float) -> float:
        """Return a duration option in seconds; its value has a unit: ``250ms``, ``5s``."""
        given = self._options.get(name)
        if given is None:
            return default_s
        found = _DURATION.fullmatch(given) if isinstance(given, str) else None
        seconds = float(found[1]) * _UNITS_S[found[2]] if found else -1.0
        if not least_s <= seconds <= most_s:
            span = f"from {least_s:g}s to {most_s:g}s"
            raise TransportError(f"{self.kind}: {name} must be {span}, not {given!r}")
        return seconds

    def place(self, plain: str) -> WebOrigin:
        """Return the target in the option `url`; with TLS, its scheme is `plain` + ``s``."""
        url = self.text("url")
        wanted = f"{self.kind}: url must be a URL such as {plain}://192.168.4.1/, not {url!r}"
        try:
            parts = urlsplit(url)
            host, port = parts.hostname, parts.port
        except ValueError as fault:
            raise TransportError(wanted) from fault
        if parts.scheme not in (plain, f"{plain}s") or not host or not _HOST.fullmatch(host):
            raise TransportError(wanted)
        if parts.username is not None or parts.password is not None:
            message = f"{self.kind}: put user and password under auth, not in the url"
            raise TransportError(message)
        if parts.fragment or port == 0 or not _PATH.fullmatch(parts.path + parts.query):
            raise TransportError(wanted)
        is_secure = parts.scheme != plain
        path = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
        return WebOrigin(is_secure, host, port or (443 if is_secure else 80), path)

    def headers(self) -> dict[str, str]:
        """Return the option `headers` as a mapping from names to values."""
        found: dict[str, str] = {}
        for name, value in self.part("headers").entries():
            text = str(value).strip()
            # The value may be a secret, so it is not shown.
            if not _TOKEN.fullmatch(name) or not text.isprintable() or not text.isascii():
                raise TransportError(f"{self.kind} cannot send the header {name[:40]!r}")
            if is_reserved(name) or name.lower() in _OURS:
                raise TransportError(f"{self.kind}: a document may not set the header {name}")
            found[name] = text
        if len(found) > MAX_HEADERS:
            raise TransportError(f"{self.kind} accepts at most {MAX_HEADERS} headers")
        return found

    def credentials(self, kinds: tuple[str, ...]) -> "Credentials | None":
        """Return the option `auth` with a type from `kinds`, or None for a missing option.

        Raises:
            TransportError: a required value of `auth` is missing.
        """
        if self._options.get("auth") is None:
            return None
        auth = self.part("auth")
        kind = auth.choice("type", kinds, "")
        if kind == "bearer":
            if not (token := auth.text("token")):
                raise TransportError(
                    f"{self.kind}: the token of auth is empty: fill in its setting"
                )
            return Credentials(kind, "", token)
        if not (user := auth.text("user")):
            raise TransportError(f"{self.kind}: the user of auth is empty: fill in its setting")
        return Credentials(kind, user, auth.text("password"))

    def tls(self, place: WebOrigin) -> Tls | None:
        """Return the TLS settings for `place`, or None if the scheme of `place` has no TLS."""
        option = self._options.get("tls")
        if place.is_secure:
            return Tls.of(self.kind, option or True)
        if option:
            raise TransportError(f"{self.kind} has tls options, but its url does not use TLS")
        return None


class Credentials(NamedTuple):
    """The credentials with which requests sign in to a web server."""

    kind: str
    user: str
    secret: str
    """Password or token."""

    @property
    def header(self) -> str:
        """Value of the Authorization header for the types ``basic`` and ``bearer``."""
        if self.kind == "bearer":
            return f"Bearer {self.secret}"
        return "Basic " + b64encode(f"{self.user}:{self.secret}".encode()).decode()


_DURATION = re.compile(r"([0-9]+(?:[.][0-9]+)?)(ms|s|m|h)")
_UNITS_S = {"ms": 0.001, "s": 1.0, "m": 60.0, "h": 3600.0}
_HOST = re.compile(r"[^\s/?#@\\\[\]]{1,253}")
_PATH = re.compile(r"[!-~]*")
_TOKEN = re.compile(r"[!#$%&'*+.^_`|~0-9A-Za-z-]{1,100}")
_OURS = {"authorization"}

"""Trusted proxies: web servers in front of URC that sign people in and send their names.

Layer 4. All functions except `read_proxy_options` are pure. URC accepts a name only together with
the proxy's secret, regardless of the network address. Both headers are removed from every request,
so neither a client nor another proxy can set a name.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from hmac import compare_digest
from typing import Final, NamedTuple

from urc.access.grants import AccessError, Grant, parse_grant
from urc.access.options_file import OptionsFile

__all__ = ["KEYS", "ProxiedRequest", "TrustedProxy", "read_proxy_options", "without_proxy_headers"]

SHORTEST_SECRET: Final = 32
"""Minimum length of the secret, in characters; 32 random letters cannot be guessed."""
KEYS: Final = ("name", "user_header", "secret_header", "secret_file", "new_people")
"""All keys that the options file may contain."""
_HEADER: Final = re.compile(r"[A-Za-z0-9-]{1,64}")
_TAKEN: Final = re.compile(
    r"host|origin|cookie|authorization|connection|upgrade|content-.*|transfer-.*|sec-.*|user-agent",
    re.IGNORECASE,
)
"""Headers with a meaning in browsers or HTTP, which a proxy must not use for names or secrets."""
_Headers = Iterable[tuple[bytes, bytes]]


@dataclass(frozen=True, slots=True)
class TrustedProxy:
    """One trusted proxy."""

    name: str
    """The proxy's name in logs."""
    user_header: bytes
    """Name of the header with the person's name, in lower case."""
    secret_header: bytes
    """Name of the header with the secret, in lower case."""
    secret: bytes = field(repr=False)
    new_people: tuple[Grant, ...] = ()
    """Grants for a new person; if empty, new people are rejected."""


class ProxiedRequest(NamedTuple):
    """One request's headers after the proxy check."""

    headers: list[tuple[bytes, bytes]]
    """The request's headers, without those that contain a proxy's secret or a user name."""
    proxy: TrustedProxy | None = None
    """The proxy whose secret was correct, or None."""
    user: str = ""
    """The person's name according to the proxy; "" if the proxy sent no name."""
    fault: str = ""
    """Reason why proxy headers were ignored; "" if none were ignored."""


def without_proxy_headers(headers: _Headers, proxies: Iterable[TrustedProxy]) -> ProxiedRequest:
    """Return a request's headers without proxy headers, and the person that a proxy confirmed.

    Args:
        headers: the request's headers, with names in lower case.
        proxies: the trusted proxies.
    """
    kept = list(headers)
    found: list[tuple[TrustedProxy, str]] = []
    fault = ""
    for proxy in proxies:
        users = [value for name, value in kept if name == proxy.user_header]
        secrets = [value for name, value in kept if name == proxy.secret_header]
        ours = (proxy.user_header, proxy.secret_header)
        kept = [pair for pair in kept if pair[0] not in ours]
        if not users and not secrets:
            continue
        # A second header with the same name is from the client; the proxy should have replaced it.
        if len(secrets) != 1 or not compare_digest(secrets[0], proxy.secret):
            fault = f"the header {proxy.user_header.decode()} came without the secret of the proxy"
        elif len(users) > 1:
            fault = f"the proxy sent the header {proxy.user_header.decode()} {len(users)} times"
        else:
            found.append((proxy, users[0].decode("utf-8", "replace").strip() if users else ""))
    if len(found) > 1:
        return ProxiedRequest(kept, fault="one request contains the secrets of several proxies")
    if not found:
        return ProxiedRequest(kept, fault=fault)
    return ProxiedRequest(kept, *found[0], fault)


def read_proxy_options(file: str) -> TrustedProxy:
    """Read and check the file that describes a proxy; return the proxy.

    Raises:
        ProblemsError: the file or the secret's file cannot be read, or a value is invalid.
    """
    options = OptionsFile(file, KEYS)
    user, secret = (_header(options, key) for key in ("user_header", "secret_header"))
    if user == secret:
        raise options.fault(("secret_header",), "expected a header other than user_header")
    options.text("secret_file")
    return TrustedProxy(
        options.text("name"),
        user,
        secret,
        options.secret("secret_file", shortest=SHORTEST_SECRET).encode(),
        tuple(_grants(options)),
    )


def _header(options: OptionsFile, key: str) -> bytes:
    name = options.text(key)
    if not _HEADER.fullmatch(name) or _TAKEN.fullmatch(name):
        raise options.fault(
            (key,), f"expected a dedicated header such as X-Forwarded-User, found {name!r}"
        )
    return name.lower().encode()


def _grants(options: OptionsFile) -> Iterable[Grant]:
    for number, text in enumerate(options.list_of("new_people")):
        path = ("new_people", number)
        if not isinstance(text, str):
            raise options.fault(path, f"expected a grant such as watch, found {text!r}")
        try:
            yield parse_grant(text)
        except AccessError as error:
            raise options.fault(path, str(error)) from None

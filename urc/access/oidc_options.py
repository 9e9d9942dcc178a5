"""The options of an OpenID Connect provider: address, credentials, and roles based on claims.

Layer 4. The file for ``--oidc`` contains the options in YAML; see ``docs/sign-in.md``.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

import httpx2

from urc.access.grants import AccessError, Grant, parse_grant
from urc.access.options_file import OptionsFile, is_loopback_host

__all__ = [
    "ANY",
    "KEYS",
    "LONGEST_H",
    "ClaimRule",
    "OidcOptions",
    "claim_values",
    "read_oidc_options",
]

ANY: Final = "*"
"""Value of a rule that matches every value of its claim."""
LONGEST_H: Final = 12.0
"""Longest permitted duration of a sign-in, in hours."""
KEYS: Final = (
    "issuer", "client_id", "client_secret_file", "title", "address", "scopes", "name",
    "authority_file", "hours", "grants",
)  # fmt: skip
"""All keys that the options file may contain."""
_RULE_KEYS: Final = ("claim", "value", "grant")
_SCOPES: Final = ("openid", "profile")
_OPENID: Final = "openid"
_MOST_RULES: Final = 200


class ClaimRule(NamedTuple):
    """One rule: a grant for people with a certain value of a claim."""

    claim: str
    """Name of the claim; dots separate nested names, as in ``realm_access.roles``."""
    value: str
    """Value that the claim must have, or that a list in the claim must contain; or `ANY`."""
    grant: Grant


@dataclass(frozen=True, slots=True)
class OidcOptions:
    """One provider's options."""

    issuer: str
    """The provider's address, exactly as written in its tokens."""
    client_id: str
    """Client ID that the provider has assigned to this server."""
    client_secret: str = field(default="", repr=False)
    """Client secret that the provider has assigned to this server; "" for a public client."""
    title: str = ""
    """Text on the sign-in button, such as the school's name."""
    address: str = ""
    """This server's public address, without a path; "" to use the address in each request."""
    scopes: tuple[str, ...] = _SCOPES
    name: str = "preferred_username"
    """Claim that contains the person's name."""
    authority_file: Path | None = None
    """Certificate authorities for the provider, in PEM format; None for the machine's own."""
    longest_s: float = LONGEST_H * 3600
    """Longest duration of a sign-in, in seconds."""
    rules: tuple[ClaimRule, ...] = ()

    def grants(self, claims: Mapping[str, Any]) -> tuple[Grant, ...]:
        """Return the grants for a person with these claims."""
        given = (
            rule.grant
            for rule in self.rules
            if (values := claim_values(claims, rule.claim))
            and (rule.value == ANY or rule.value in values)
        )
        return tuple(dict.fromkeys(given))


def claim_values(claims: Mapping[str, Any], name: str) -> tuple[str, ...]:
    """Return a claim's values as text, one for each item of a list; () for a missing claim.

    Args:
        claims: a token's claims.
        name: name of the claim, or a path with dots.
    """
    if name in claims:
        return _values(claims[name])
    found: Any = claims
    for part in name.split("."):
        if not isinstance(found, Mapping) or part not in found:
            return ()
        found = found[part]
    return _values(found)


def _values(found: Any) -> tuple[str, ...]:
    if isinstance(found, list):
        return tuple(value for each in found for value in _values_of_one(each))
    return _values_of_one(found)


def _values_of_one(found: Any) -> tuple[str, ...]:
    if isinstance(found, bool):
        return ("true" if found else "false",)
    return (str(found),) if isinstance(found, str | int | float) and found != "" else ()


def read_oidc_options(file: str) -> OidcOptions:
    """Read the options in a YAML file, and check them.

    Raises:
        ProblemsError: the file or a secret's file cannot be read, or a value is invalid.
    """
    options = OptionsFile(file, KEYS)
    issuer = options.text("issuer")
    _check_url(options, "issuer", issuer)
    address = options.text("address", "")
    if address:
        _check_url(options, "address", address, is_origin=True)
    scopes = tuple(options.list_of("scopes")) or _SCOPES
    if _OPENID not in scopes or not all(
        isinstance(each, str) and each.isascii() and each.isprintable() and " " not in each
        for each in scopes
    ):
        raise options.fault(("scopes",), f"expected a list of scopes that contains {_OPENID!r}")
    authority = options.text("authority_file", "")
    if authority and not (options.folder / authority).is_file():
        raise options.fault(("authority_file",), f"there is no file {options.folder / authority}")
    return OidcOptions(
        issuer,
        options.text("client_id"),
        options.secret("client_secret_file"),
        options.text("title", str(httpx2.URL(issuer).host)),
        address.rstrip("/"),
        scopes,
        options.text("name", "preferred_username"),
        options.folder / authority if authority else None,
        _hours(options) * 3600,
        _rules(options),
    )


def _check_url(options: OptionsFile, key: str, text: str, *, is_origin: bool = False) -> None:
    try:
        url = httpx2.URL(text)
    except httpx2.InvalidURL:
        url = httpx2.URL("")
    is_private = url.scheme == "https" or (url.scheme == "http" and is_loopback_host(url.host))
    if not is_private or not url.host or url.userinfo or url.query or url.fragment:
        raise options.fault((key,), f"expected an address with https://, found {text!r}")
    if is_origin and url.path not in ("", "/"):
        raise options.fault((key,), f"expected an address without a path, found {text!r}")


def _hours(options: OptionsFile) -> float:
    hours = options.data.get("hours", LONGEST_H)
    if isinstance(hours, bool) or not isinstance(hours, int | float) or not 0 < hours <= LONGEST_H:
        raise options.fault(
            ("hours",), f"expected a number of hours up to {LONGEST_H:g}, found {hours!r}"
        )
    return float(hours)


def _rules(options: OptionsFile) -> tuple[ClaimRule, ...]:
    found = options.list_of("grants")
    if len(found) > _MOST_RULES:
        raise options.fault(("grants",), f"expected at most {_MOST_RULES} rules")
    rules = []
    for number, data in enumerate(found):
        path = ("grants", number)
        if not isinstance(data, dict):
            raise options.fault(path, "expected the keys claim, value and grant", "wrong-type")
        options.check_keys(path, data, _RULE_KEYS)
        value = data.get("value")
        if isinstance(value, bool | int | float):
            data = data | {"value": "".join(_values_of_one(value))}
        claim, value, grant = (options.text_in(path, data, key) for key in _RULE_KEYS)
        try:
            rules.append(ClaimRule(claim, value, parse_grant(grant)))
        except AccessError as error:
            raise options.fault((*path, "grant"), str(error)) from None
    if not rules:
        raise options.fault((), "'grants' is missing: without a rule, no account gets a role",
                            "missing-key")  # fmt: skip
    return tuple(rules)

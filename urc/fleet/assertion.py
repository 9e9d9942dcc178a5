"""Assertions: who acts from another site, and what the fleet proposes that this person may do.

Layer 4. The site where a person has signed in signs an assertion with the key of its certificate.
The other site checks the assertion against the certificate that TLS has proven. It may grant less
than the assertion proposes. Assertions are JSON Web Tokens (RFC 7519), signed with ES256.
"""

import re
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, Final, get_args

from urc.fleet.certificates import duration
from urc.model.role import Role
from urc.problems import UrcError

__all__ = [
    "LASTS_S", "SCHEME", "Assertion", "BadAssertion", "clock_refusal",
    "sign_assertion", "verified_assertion",
]  # fmt: skip

LASTS_S: Final = 30.0
"""Time for which an assertion is valid, in seconds. Open sockets renew it."""
SCHEME: Final = "Urc-Site"
"""Scheme of the HTTP header ``Authorization`` that carries an assertion."""
_CLOCKS_S: Final = 60.0
"""Accepted difference between the clocks of two sites, in seconds."""
_ALGORITHM: Final = "ES256"
_MAX_BYTES: Final = 4096
_TEXTS: Final = ("sub", "name", "kind", "sign_in", "robot", "role", "place")
_LONGEST: Final = 200
_VISIT: Final = re.compile(r"[A-Za-z0-9_-]{0,64}")


class BadAssertion(UrcError):
    """The assertion is not accepted; the message is one line."""


@dataclass(frozen=True, slots=True)
class Assertion:
    """A person, device or program of another site, and one robot that it wants to use."""

    principal: str
    """Identifier at the site that asserts."""
    name: str
    kind: str
    """``person``, ``device``, ``program`` or ``guest``."""
    sign_in: str
    """Identifier of the sign-in at the site that asserts."""
    robot: str
    """Name of the robot at the site that receives the assertion."""
    role: Role
    """Role that the fleet proposes."""
    place: str = ""
    """Network address of the person at the site that asserts."""
    visit: str = ""
    """Identifier of the visit in the audit logs of both sites; "" from older versions of URC."""
    version: str = ""
    """Version of URC at the site that asserts; "" from older versions of URC."""


def sign_assertion(
    assertion: Assertion, *, issuer: str, audience: str, key_pem: bytes, now: float
) -> str:
    """Return a signed assertion.

    Args:
        assertion: the content.
        issuer: the site that asserts.
        audience: the site that shall accept the assertion, and no other.
        key_pem: private key of the issuer's certificate.
        now: UTC time in seconds since 1970.
    """
    from joserfc import jwt  # an extra
    from joserfc.jwk import ECKey

    claims: dict[str, Any] = {
        "iss": issuer,
        "aud": audience,
        "sub": assertion.principal,
        "name": assertion.name[:_LONGEST],
        "kind": assertion.kind,
        "sign_in": assertion.sign_in,
        "robot": assertion.robot,
        "role": assertion.role,
        "place": assertion.place,
        "visit": assertion.visit,
        "version": assertion.version,
        "iat": int(now),
        "exp": int(now + LASTS_S) + 1,
        "jti": secrets.token_urlsafe(12),
    }
    return jwt.encode({"alg": _ALGORITHM}, claims, ECKey.import_key(key_pem))


def verified_assertion(
    text: str, *, issuer: str, audience: str, key_pem: bytes, now: float
) -> Assertion:
    """Return the content of an assertion.

    Args:
        text: the signed assertion.
        issuer: the site at the other end of the TLS connection.
        audience: this site.
        key_pem: public key of the issuer's certificate.
        now: UTC time in seconds since 1970.

    Raises:
        BadAssertion: the assertion is damaged, too old, from the future, for another site, or
            signed by another key.
    """
    from joserfc import jwt
    from joserfc.errors import JoseError
    from joserfc.jwk import ECKey

    if len(text) > _MAX_BYTES:
        raise BadAssertion("the assertion is too long")
    try:
        claims = jwt.decode(text, ECKey.import_key(key_pem), algorithms=[_ALGORITHM]).claims
    except (JoseError, ValueError) as fault:
        raise BadAssertion("the assertion is not signed by the site that sends it") from fault
    if claims.get("iss") != issuer or claims.get("aud") != audience:
        raise BadAssertion("the assertion is from or for another site")
    begins, ends = claims.get("iat"), claims.get("exp")
    if not isinstance(begins, int) or not isinstance(ends, int):
        raise BadAssertion("the assertion has no times")
    if ends - begins > LASTS_S + 2:
        raise BadAssertion(
            f"the assertion lasts {ends - begins} s; at most {LASTS_S:g} s are valid"
        )
    if now > ends + _CLOCKS_S:
        raise BadAssertion(
            f"the assertion of the site {issuer} ended {_time(now - ends)} ago; compare the clocks"
            f" of the sites {issuer} and {audience}"
        )
    if refused := clock_refusal(issuer, audience, max(0.0, begins - now)):
        raise BadAssertion(refused)
    return _parsed(claims)


def clock_refusal(site: str, other: str, ahead_s: float) -> str:
    """Return why two sites do not accept each other's assertions, as one line; "" if they do.

    Args:
        site: a site.
        other: another site.
        ahead_s: time by which the clock of `site` is ahead, in seconds; negative if it is behind.
    """
    if abs(ahead_s) <= _CLOCKS_S:
        return ""
    fast, slow = (site, other) if ahead_s > 0 else (other, site)
    return (
        f"the clock of the site {fast} is {_time(abs(ahead_s))} ahead of the clock of the site"
        f" {slow}; set the wrong clock"
    )


def _time(seconds: float) -> str:
    return duration(timedelta(seconds=seconds))


def _parsed(claims: Mapping[str, object]) -> Assertion:
    texts: dict[str, str] = {}
    for name in _TEXTS:
        value = claims.get(name)
        if not isinstance(value, str) or len(value) > _LONGEST:
            raise BadAssertion(f"the assertion has no valid {name!r}")
        texts[name] = value
    role = next((one for one in get_args(Role) if one == texts["role"]), None)
    if role is None or texts["kind"] not in ("person", "device", "program", "guest"):
        raise BadAssertion("the assertion has an unknown role or kind")
    visit = claims.get("visit", "")
    if not isinstance(visit, str) or not _VISIT.fullmatch(visit):
        raise BadAssertion("the assertion has no valid 'visit'")
    version = claims.get("version", "")
    if not isinstance(version, str) or len(version) > _LONGEST:
        raise BadAssertion("the assertion has no valid 'version'")
    return Assertion(
        texts["sub"], texts["name"], texts["kind"], texts["sign_in"], texts["robot"], role,
        texts["place"], visit, version,
    )  # fmt: skip

"""Validation of ID tokens (OpenID Connect Core 1.0, 3.1.3.7).

Layer 4. Pure. Only asymmetric signatures are allowed. A provider can choose neither ``none`` nor a
signature with a shared secret, because a page may know the secret. The provider sends its keys over
TLS.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from urc.access.grants import AccessError

__all__ = ["ALGORITHMS", "LEEWAY_S", "UnknownKey", "verified_claims"]

ALGORITHMS: Final = (
    "RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "ES256", "ES384", "ES512",
    "Ed25519",
)  # fmt: skip
"""Allowed signature algorithms (RFC 7518, RFC 9864)."""
LEEWAY_S: Final = 60.0
"""Tolerated difference between this machine's clock and the provider's clock, in seconds."""
_SHORTEST_RSA: Final = 2048
_LONGEST_TOKEN: Final = 65536


class UnknownKey(AccessError):
    """Raised for a token that was signed with an unknown key."""


def verified_claims(
    token: str,
    keys: Sequence[Mapping[str, Any]],
    *,
    issuer: str,
    client_id: str,
    nonce: str,
    now: float,
) -> dict[str, Any]:
    """Return the claims of an ID token after validation.

    Args:
        token: the token.
        keys: the provider's keys, as JSON Web Keys (RFC 7517).
        issuer: expected issuer.
        client_id: this server's identifier at the provider.
        nonce: random text that belongs to this sign-in.
        now: UTC time in seconds since 1970.

    Raises:
        UnknownKey: no key matches, but the provider may have newer keys.
        AccessError: the token is invalid or too old, or belongs to another sign-in or server.
    """
    claims = _signed(token, keys)
    audience = claims.get("aud")
    audiences = audience if isinstance(audience, list) else [audience]
    party = claims.get("azp")
    if claims.get("iss") != issuer:
        raise AccessError(
            "the provider's token names a different issuer from the one in the options"
        )
    if client_id not in audiences or (party is None and len(audiences) > 1):
        raise AccessError("the provider's token is for another server")
    if party is not None and party != client_id:
        raise AccessError("the provider's token is for another server")
    if not nonce or claims.get("nonce") != nonce:
        raise AccessError("the provider's token is for another sign-in")
    if not isinstance(claims.get("sub"), str) or not 0 < len(claims["sub"]) <= 255:
        raise AccessError("the provider's token names no account")
    _check_times(claims, now)
    return claims


def _check_times(claims: Mapping[str, Any], now: float) -> None:
    ends, begins = _time(claims, "exp"), _time(claims, "iat")
    if now >= ends + LEEWAY_S or now < begins - LEEWAY_S:
        raise AccessError(
            "the provider's token is not valid according to this machine's clock: check both clocks"
        )


def _time(claims: Mapping[str, Any], name: str) -> float:
    found = claims.get(name)
    if isinstance(found, bool) or not isinstance(found, int | float):
        raise AccessError(f"the provider's token has no valid time {name!r}")
    return found


def _signed(token: str, keys: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return a token's claims if its signature is valid."""
    from joserfc import jws, jwt
    from joserfc.errors import BadSignatureError, JoseError

    if len(token) > _LONGEST_TOKEN:
        raise AccessError("the provider's token is too long")
    try:
        header = jws.extract_compact(token.encode()).headers()
    except (JoseError, ValueError, TypeError, AttributeError, RecursionError):
        raise AccessError("the provider sent no valid token") from None
    algorithm, name = header.get("alg"), header.get("kid")
    if algorithm not in ALGORITHMS:
        raise AccessError(f"the provider signs with {algorithm!r}, which is not allowed")
    # Providers may add their own header members; unknown critical members are still rejected.
    registry = jws.JWSRegistry(algorithms=[algorithm], strict_check_header=False)
    for key in (one for one in keys if name is None or one.get("kid") == name):
        try:
            return dict(jwt.decode(token, _key(key), registry=registry).claims)
        except BadSignatureError:
            if name is not None:
                raise AccessError("the signature of the provider's token is wrong") from None
        except (JoseError, ValueError, TypeError, KeyError):
            continue  # a key for another algorithm
    raise UnknownKey("the provider's token is signed with an unknown key")


def _key(data: Mapping[str, Any]) -> Any:
    """Return the key in `data` for checking signatures; raise `ValueError` if it is unsuitable."""
    from joserfc.jwk import ECKey, OKPKey, RSAKey

    kinds: dict[object, type[RSAKey | ECKey | OKPKey]] = {"RSA": RSAKey, "EC": ECKey, "OKP": OKPKey}
    kind = data.get("kty")
    if kind not in kinds or data.get("use", "sig") != "sig":
        raise ValueError("a key for another purpose")
    # Each base64 character encodes six bits.
    if kind == "RSA" and len(str(data.get("n"))) * 6 < _SHORTEST_RSA:
        raise ValueError("a short key")
    return kinds[kind].import_key(dict(data))

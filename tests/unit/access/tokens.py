"""ID tokens, signed here from RFC 7515 and RFC 7518 without the library that URC uses."""

import hmac
import json
from typing import Any

from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec, padding, rsa
from cryptography.hazmat.primitives.asymmetric.utils import decode_dss_signature

from tests.authenticator import b64

RSA_KEY = rsa.generate_private_key(65537, 2048)
OTHER_RSA_KEY = rsa.generate_private_key(65537, 2048)
EC_KEY = ec.generate_private_key(ec.SECP256R1())


def _number(value: int) -> str:
    return b64(value.to_bytes((value.bit_length() + 7) // 8, "big"))


def jwk(key: rsa.RSAPrivateKey | ec.EllipticCurvePrivateKey, **more: str) -> dict[str, Any]:
    """Return the public key as a JSON Web Key."""
    if isinstance(key, rsa.RSAPrivateKey):
        public = key.public_key().public_numbers()
        return {"kty": "RSA", "n": _number(public.n), "e": _number(public.e), **more}
    point = key.public_key().public_numbers()
    x, y = (b64(each.to_bytes(32, "big")) for each in (point.x, point.y))
    return {"kty": "EC", "crv": "P-256", "x": x, "y": y, **more}


def sign(claims: object, *, algorithm: str = "RS256", key: Any = RSA_KEY, **header: object) -> str:
    """Return a token; `key` is a text for HS256."""
    parts = ({"alg": algorithm, **header}, claims)
    text = ".".join(b64(json.dumps(part).encode()) for part in parts)
    return f"{text}.{b64(_signature(text.encode(), algorithm, key))}"


def _signature(data: bytes, algorithm: str, key: Any) -> bytes:
    match algorithm:
        case "RS256":
            signed: bytes = key.sign(data, padding.PKCS1v15(), hashes.SHA256())
            return signed
        case "ES256":
            r, s = decode_dss_signature(key.sign(data, ec.ECDSA(hashes.SHA256())))
            return r.to_bytes(32, "big") + s.to_bytes(32, "big")
        case "HS256":
            return hmac.digest(key.encode(), data, "sha256")
    return b""

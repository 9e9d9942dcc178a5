"""A software authenticator: it answers the ceremonies of WebAuthn as a phone does.

Written from the WebAuthn standard (level 3, sections 5.8.1, 6.1 and 6.5) and CBOR (RFC 8949), with
no code of the library that URC uses.
"""

import hashlib
import json
import secrets
from base64 import urlsafe_b64decode, urlsafe_b64encode
from dataclasses import dataclass, field
from typing import Any

from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec

PRESENT, VERIFIED, ATTESTED = 0x01, 0x04, 0x40


def b64(data: bytes) -> str:
    return urlsafe_b64encode(data).rstrip(b"=").decode()


def unb64(text: str) -> bytes:
    return urlsafe_b64decode(text + "=" * (-len(text) % 4))


def cbor(value: object) -> bytes:
    """Encode integers, byte strings, text and maps."""
    match value:
        case int():
            return _head(0, value) if value >= 0 else _head(1, -1 - value)
        case bytes():
            return _head(2, len(value)) + value
        case str():
            return _head(3, len(value.encode())) + value.encode()
        case dict():
            pairs = (cbor(key) + cbor(each) for key, each in value.items())
            return _head(5, len(value)) + b"".join(pairs)
    raise TypeError(value)


def _head(kind: int, number: int) -> bytes:
    for bits, size, limit in ((24, 1, 1 << 8), (25, 2, 1 << 16), (26, 4, 1 << 32)):
        if number < 24:
            return bytes([kind << 5 | number])
        if number < limit:
            return bytes([kind << 5 | bits]) + number.to_bytes(size, "big")
    raise ValueError(number)


@dataclass
class Credential:
    """One passkey in the authenticator."""

    host: str
    user: bytes
    key: ec.EllipticCurvePrivateKey
    id: bytes = field(default_factory=lambda: secrets.token_bytes(32))
    count: int = 0


@dataclass
class Authenticator:
    """A phone; its attributes change one detail of the answers, as an attacker would."""

    origin: str
    credentials: list[Credential] = field(default_factory=list)
    flags: int = PRESENT | VERIFIED
    has_counter: bool = True
    extra: dict[str, Any] = field(default_factory=dict)
    """Members of the client data that replace or join the usual ones."""

    def create(self, options: dict[str, Any]) -> dict[str, Any]:
        """Return the result of ``navigator.credentials.create``."""
        assert any(each["alg"] == -7 for each in options["pubKeyCredParams"])
        made = Credential(
            options["rp"]["id"],
            unb64(options["user"]["id"]),
            ec.generate_private_key(ec.SECP256R1()),
        )
        self.credentials.append(made)
        point = made.key.public_key().public_numbers()
        public = cbor(
            {1: 2, 3: -7, -1: 1, -2: point.x.to_bytes(32, "big"), -3: point.y.to_bytes(32, "big")}
        )
        attested = bytes(16) + len(made.id).to_bytes(2, "big") + made.id + public
        data = self._data(made, self.flags | ATTESTED) + attested
        return self._answer(
            made,
            {
                "clientDataJSON": b64(self._client_data("webauthn.create", options["challenge"])),
                "attestationObject": b64(cbor({"fmt": "none", "attStmt": {}, "authData": data})),
                "transports": ["internal"],
            },
        )

    def get(self, options: dict[str, Any]) -> dict[str, Any]:
        """Return the result of ``navigator.credentials.get`` for a passkey that is kept here."""
        mine = next(each for each in self.credentials if each.host == options["rpId"])
        mine.count += self.has_counter
        data = self._data(mine, self.flags)
        client = self._client_data("webauthn.get", options["challenge"])
        signature = mine.key.sign(data + hashlib.sha256(client).digest(), ec.ECDSA(hashes.SHA256()))
        return self._answer(
            mine,
            {
                "clientDataJSON": b64(client),
                "authenticatorData": b64(data),
                "signature": b64(signature),
                "userHandle": b64(mine.user),
            },
        )

    def _data(self, one: Credential, flags: int) -> bytes:
        return (
            hashlib.sha256(one.host.encode()).digest()
            + bytes([flags])
            + one.count.to_bytes(4, "big")
        )

    def _client_data(self, kind: str, challenge: str) -> bytes:
        said = {"type": kind, "challenge": challenge, "origin": self.origin, "crossOrigin": False}
        return json.dumps(said | self.extra).encode()

    def _answer(self, one: Credential, response: dict[str, Any]) -> dict[str, Any]:
        return {
            "id": b64(one.id),
            "rawId": b64(one.id),
            "type": "public-key",
            "authenticatorAttachment": "platform",
            "clientExtensionResults": {},
            "response": response,
        }

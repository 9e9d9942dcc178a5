"""Client authentication by a simulated web server: Basic, Bearer or Digest (RFC 7616)."""

import hashlib
import hmac
import re
import secrets
from base64 import b64encode
from collections.abc import Mapping

__all__ = ["HttpAuth"]

_REALM = "robot"
_FIELD = re.compile(r'(\w+)=(?:"([^"]*)"|([^\s,]*))')


class HttpAuth:
    """Checks the credentials of requests against the driver's `auth` option."""

    def __init__(self, auth: object) -> None:
        """Read the option `auth`. Without this option, every request is accepted."""
        self._auth: Mapping[str, object] = auth if isinstance(auth, Mapping) else {}
        self._nonce = secrets.token_hex(16)

    def challenge(self, method: str, target: str, given: str) -> str | None:
        """Return the challenge if a request's credentials are invalid, otherwise None.

        Args:
            method: method of the request.
            target: target of the request, as received.
            given: value of the Authorization header.
        """
        kind = self._auth.get("type")
        user, password = self._text("user"), self._text("password")
        if kind == "basic":
            wanted = "Basic " + b64encode(f"{user}:{password}".encode()).decode()
            return None if _same(given, wanted) else f'Basic realm="{_REALM}"'
        if kind == "bearer":
            return None if _same(given, f"Bearer {self._text('token')}") else "Bearer"
        if kind == "digest":
            if self._is_digest(method, target, given, f"{user}:{_REALM}:{password}"):
                return None
            return f'Digest realm="{_REALM}", qop="auth", algorithm=MD5, nonce="{self._nonce}"'
        return None

    def _is_digest(self, method: str, target: str, given: str, identity: str) -> bool:
        fields = {name: quoted or plain for name, quoted, plain in _FIELD.findall(given)}
        if not given.startswith("Digest ") or fields.get("nonce") != self._nonce:
            return False
        if fields.get("uri") != target:
            return False
        count = ":".join(fields.get(name, "") for name in ("nc", "cnonce", "qop"))
        secret, asked = _hash(identity), _hash(f"{method}:{target}")
        return _same(fields.get("response", ""), _hash(f"{secret}:{self._nonce}:{count}:{asked}"))

    def _text(self, name: str) -> str:
        return str(self._auth.get(name) or "")


def _hash(text: str) -> str:
    # Every client supports this algorithm, and most cameras require it.
    return hashlib.md5(text.encode(), usedforsecurity=False).hexdigest()


def _same(found: str, wanted: str) -> bool:
    return hmac.compare_digest(found.encode(), wanted.encode())

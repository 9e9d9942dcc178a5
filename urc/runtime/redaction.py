"""Redact the values of secret settings in all displayed or stored data.

Layer 4, pure. The engine marks secret frames, and the link redacts these frames. This module
redacts all other data for the hub, such as the echo of a password or a command with a token. An
echo may arrive in a stream one character at a time. Bytes that may be the beginning of a secret are
therefore held back until more data arrives, or until a pause.
"""

import base64
import re
from collections.abc import Iterable, Mapping
from typing import Any

from urc.model.payload import Envelope
from urc.model.profile import Profile
from urc.model.values import Value
from urc.runtime.secret_forms import forms

__all__ = ["REDACTED", "Redactor", "secret_texts", "stand_ins"]

REDACTED = "‹secret›".encode()
"""Text that replaces a secret in displayed data."""

_SHORTEST = 3
"""Minimum length, in bytes, of a secret that is replaced inside a frame. A shorter secret would
match too many bytes, so a frame that contains a shorter secret is hidden completely."""
_SHORTEST_CODED = 6
_SHORTEST_PART = 4
"""Minimum length, in bytes, of the beginning of a secret to redact; shorter ones occur in many
words."""
_SHORTEST_NUMBER = 4
"""Minimum number of digits in a secret number to redact; shorter numbers match too many
readings."""
_CUT = re.compile(rb"['\"]?\s*(?:\.\.\.|\xe2\x80\xa6|['\"]|$)")
"""Text after a truncated value: dots, a quotation mark, or the end of the text."""


def stand_ins(profile: Profile, settings: Mapping[str, Value]) -> dict[str, Value]:
    """Return the settings for a document's tests, with placeholders in place of secrets."""
    return {
        name: "SECRET" if profile.settings[name].is_secret and isinstance(value, str) else value
        for name, value in settings.items()
        if name in profile.settings
    }


def secret_texts(profile: Profile, settings: Mapping[str, Value]) -> list[str]:
    """Return the values of a robot's secret settings as text."""
    return [
        str(settings[name])
        for name, setting in profile.settings.items()
        if setting.is_secret and settings.get(name) is not None
    ]


class Redactor:
    """A filter that replaces secrets in frames, text and streams."""

    def __init__(self, secrets: Iterable[str], encodings: Iterable[str] = ("utf-8",)) -> None:
        """Prepare the redaction of `secrets` in the given encodings; empty secrets are ignored."""
        names, texts = tuple(encodings), [text for text in secrets if text]
        written = [text.encode(name, "replace") for text in texts for name in names]
        self._plain = tuple(dict.fromkeys(written))
        coded = [code for secret in self._plain for code in _base64(secret)]
        coded += [form.encode("utf-8", "replace") for text in texts for form in forms(text)]
        # Longest first, because one secret may be part of another secret.
        found = dict.fromkeys((*self._plain, *coded))
        self._all = tuple(sorted(found, key=len, reverse=True))
        self._long = tuple(secret for secret in self._all if len(secret) >= _SHORTEST)
        self._short = tuple(
            re.compile(rf"(?<!\w){re.escape(text)}(?!\w)")
            for text in texts
            if len(text.encode("utf-8", "replace")) < _SHORTEST
        )
        """Short secrets, which are redacted only as whole words in text; otherwise, most text would
        be unreadable."""
        self._numbers = frozenset(
            int(text) for text in texts if text.isdecimal() and len(text) >= _SHORTEST_NUMBER
        )
        self._held: dict[tuple[str, str], bytes] = {}

    @classmethod
    def of(cls, profile: Profile, settings: Mapping[str, Value]) -> "Redactor":
        """Return the redactor for a robot's secret settings."""
        secrets = secret_texts(profile, settings)
        encodings = (spec.encoding for spec in profile.driver.transports.values())
        return cls(secrets, dict.fromkeys(("utf-8", *encodings)))

    @property
    def is_needed(self) -> bool:
        """Whether the robot has any secrets."""
        return bool(self._all)

    def whole(self, data: bytes) -> bytes:
        """Return the redacted form of one frame."""
        for secret in self._all:
            if secret in data:
                if len(secret) < _SHORTEST:
                    return REDACTED
                data = data.replace(secret, REDACTED)
        return data

    def text(self, text: str) -> str:
        """Return the redacted form of `text`, which may end with a truncated secret."""
        if not self._all:
            return text
        if any(word.search(text) for word in self._short):
            return REDACTED.decode()
        shown = text.encode("utf-8", "replace")
        for secret in self._long:
            shown = _without_cut(secret, shown.replace(secret, REDACTED))
        return shown.decode("utf-8", "replace")

    def value(self, value: Any) -> Any:
        """Return the redacted form of a reading; a secret number becomes None."""
        if isinstance(value, str):
            return self.text(value)
        if isinstance(value, bytes):
            return self._in_bytes(value)
        if isinstance(value, tuple | list):
            return tuple(map(self.value, value))
        if isinstance(value, Mapping):
            return {self.value(name): self.value(one) for name, one in value.items()}
        return None if value in self._numbers else value

    def _in_bytes(self, data: bytes) -> bytes:
        """Return the redacted form of a blob; only long secrets are redacted in blobs."""
        for secret in self._long:
            if len(secret) >= _SHORTEST_PART:
                data = data.replace(secret, REDACTED)
        return data

    def envelope(self, envelope: Envelope) -> Envelope:
        """Return the redacted form of a message envelope."""
        shown = self.value(envelope.attributes)
        return envelope._replace(attributes=shown, body=self.value(envelope.body))

    def stream(self, key: tuple[str, str], data: bytes) -> bytes:
        """Add `data` to the stream `key`; return the redacted data that can now be shown."""
        if not self._all:
            return data
        shown = self.whole(self._held.pop(key, b"") + data)
        kept = self._beginning(shown)
        if kept:
            self._held[key] = shown[len(shown) - kept :]
            shown = shown[: len(shown) - kept]
        return shown

    @property
    def is_holding(self) -> bool:
        """Whether a possible beginning of a secret is held back."""
        return bool(self._held)

    def rest(self) -> list[tuple[tuple[str, str], bytes]]:
        """Remove and return the held-back data of each stream, because no more data arrived."""
        held = list(self._held.items())
        self._held.clear()
        return [(key, REDACTED if len(data) >= _SHORTEST else data) for key, data in held]

    def _beginning(self, data: bytes) -> int:
        """Return the number of bytes at the end of `data` that may be the beginning of a secret."""
        longest = 0
        for secret in self._all:
            for size in range(min(len(secret) - 1, len(data)), longest, -1):
                if data.endswith(secret[:size]):
                    longest = size
                    break
        return longest


def _base64(secret: bytes) -> list[bytes]:
    """Return the forms of a secret inside base64 text, one per byte alignment."""
    found = []
    for shift in range(3):
        code = base64.b64encode(bytes(shift) + secret).rstrip(b"=")
        first = (shift * 8 + 5) // 6
        whole = (shift + len(secret)) * 8 // 6
        if whole - first >= _SHORTEST_CODED:
            found.append(code[first:whole])
    return found


def _without_cut(secret: bytes, shown: bytes) -> bytes:
    """Return `shown` without a truncated secret at the end or before a quotation mark."""
    at = shown.find(secret[:_SHORTEST_PART])
    while at >= 0 and len(secret) > _SHORTEST_PART:
        size = _SHORTEST_PART
        while shown[at + size : at + size + 1] == secret[size : size + 1] != b"":
            size += 1
        if _CUT.match(shown, at + size):
            shown = shown[:at] + REDACTED + shown[at + size :]
        at = shown.find(secret[:_SHORTEST_PART], at + 1)
    return shown

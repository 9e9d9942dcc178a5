"""The values of secret settings, taken out of traffic that is shown or kept.

Floor 4, pure. The engine says which frames are secret and the hub blanks them; a robot that echoes
a password, or a command that carries a token, is blanked here. A stream may bring an echo letter by
letter: what may be the beginning of a secret is held back until more of it has come, or nothing has
for a while.
"""

import base64
from collections.abc import Iterable, Mapping

from urc.model.profile import Profile
from urc.model.values import Value
from urc.runtime.disguise import forms
from urc.runtime.report import REDACTED

__all__ = ["Blanker", "secret_texts", "stand_ins"]

_SHORTEST = 3
"""A shorter secret would blot out half of every frame; then the whole of it is blanked."""
_SHORTEST_CODED = 6


def stand_ins(profile: Profile, settings: Mapping[str, Value]) -> dict[str, Value]:
    """Return the settings with a word in place of every secret, for what is only tried out."""
    return {
        name: "SECRET" if profile.settings[name].is_secret and isinstance(value, str) else value
        for name, value in settings.items()
        if name in profile.settings
    }


def secret_texts(profile: Profile, settings: Mapping[str, Value]) -> list[str]:
    """Return the values of a robot's secret settings."""
    return [
        str(settings[name])
        for name, setting in profile.settings.items()
        if setting.is_secret and settings.get(name) is not None
    ]


class Blanker:
    """Takes secrets out of frames, texts and streams."""

    def __init__(self, secrets: Iterable[str], encodings: Iterable[str] = ("utf-8",)) -> None:
        """Prepare for these, written in any of the encodings; empty ones are none."""
        names, texts = tuple(encodings), [text for text in secrets if text]
        self._texts = frozenset(texts)
        written = [text.encode(name, "replace") for text in texts for name in names]
        self._plain = tuple(dict.fromkeys(written))
        coded = [code for secret in self._plain for code in _base64(secret)]
        coded += [form.encode("utf-8", "replace") for text in texts for form in forms(text)]
        # Longest first: one secret may be part of another.
        found = dict.fromkeys((*self._plain, *coded))
        self._all = tuple(sorted(found, key=len, reverse=True))
        self._held: dict[tuple[str, str], bytes] = {}

    @classmethod
    def of(cls, profile: Profile, settings: Mapping[str, Value]) -> "Blanker":
        """Return the one for a robot's secret settings."""
        secrets = secret_texts(profile, settings)
        encodings = (spec.encoding for spec in profile.driver.transports.values())
        return cls(secrets, dict.fromkeys(("utf-8", *encodings)))

    @property
    def is_needed(self) -> bool:
        """Whether there is any secret."""
        return bool(self._all)

    def is_one(self, value: object) -> bool:
        """Return whether a value is a secret: a number has no letters to be found in."""
        return bool(self._texts) and str(value) in self._texts

    def whole(self, data: bytes) -> bytes:
        """Return what is shown of one frame."""
        for secret in self._all:
            if secret in data:
                if len(secret) < _SHORTEST:
                    return REDACTED
                data = data.replace(secret, REDACTED)
        return data

    def text(self, text: str) -> str:
        """Return what is shown of a text."""
        if not self._all:
            return text
        return self.whole(text.encode("utf-8", "replace")).decode("utf-8", "replace")

    def stream(self, key: tuple[str, str], data: bytes) -> bytes:
        """Return what is shown now of the stream `key`, to which `data` was added."""
        if not self._all:
            return data
        shown = self.whole(self._held.pop(key, b"") + data)
        kept = self._beginning(shown)
        if kept:
            self._held[key] = shown[len(shown) - kept :]
            shown = shown[: len(shown) - kept]
        return shown

    def rest(self) -> list[tuple[tuple[str, str], bytes]]:
        """Return what was held back of each stream, on which nothing has come for a while."""
        held = list(self._held.items())
        self._held.clear()
        return [(key, REDACTED if len(data) >= _SHORTEST else data) for key, data in held]

    def _beginning(self, data: bytes) -> int:
        """Return how many bytes at the end of `data` may begin a secret."""
        longest = 0
        for secret in self._all:
            for size in range(min(len(secret) - 1, len(data)), longest, -1):
                if data.endswith(secret[:size]):
                    longest = size
                    break
        return longest


def _base64(secret: bytes) -> list[bytes]:
    """Return how a secret looks inside of base64 text, wherever in it the secret begins."""
    found = []
    for shift in range(3):
        code = base64.b64encode(bytes(shift) + secret).rstrip(b"=")
        first = (shift * 8 + 5) // 6
        whole = (shift + len(secret)) * 8 // 6
        if whole - first >= _SHORTEST_CODED:
            found.append(code[first:whole])
    return found

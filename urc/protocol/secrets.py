"""Text that nobody may see.

Floor 3, pure.
"""

from collections import deque
from typing import Final

__all__ = ["Secrets"]

_HIDDEN: Final = "•••"
_MOST_SECRETS: Final = 8
_SHORTEST: Final = 3
"""Shorter secrets would blot out half of every message; then the whole of it is hidden."""


class Secrets:
    """What was sent on a connection and must not be shown, not even when the robot echoes it."""

    __slots__ = ("_texts",)

    def __init__(self) -> None:
        self._texts: deque[str] = deque(maxlen=_MOST_SECRETS)

    def add(self, data: bytes, encoding: str) -> None:
        """Take note of bytes that hold a secret."""
        text = data.decode(encoding, "replace").strip()
        if text:
            self._texts.append(text)

    def hide(self, text: str) -> str:
        """Return a message without the secrets."""
        for secret in self._texts:
            if secret in text:
                text = text.replace(secret, _HIDDEN) if len(secret) >= _SHORTEST else _HIDDEN
        return text

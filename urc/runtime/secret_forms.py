"""The forms, plain or encoded, that a secret may have in sent data."""

import base64
import json
import re
from collections.abc import Iterable
from urllib.parse import quote, quote_plus

__all__ = ["HIDDEN", "SecretForms", "forms"]

HIDDEN = "•••"
_SHORTEST = 4
"""Minimum length of a secret whose encoded forms are searched for; shorter forms match too
often."""
_LONGEST = 4096


class SecretForms:
    """A search for secrets in plain text and in JSON, URL, hex and base64 encodings.

    A secret in base64 may be part of longer text, such as ``user:password`` in a header. In base64,
    the whole encoded text is hidden, because neighbouring bytes change the first and last letters.
    """

    def __init__(self, secrets: Iterable[str] = ()) -> None:
        known = [one for one in secrets if one]
        plain = {form for one in known for form in forms(one)}
        # Longest first, because one secret may be part of another secret.
        self._plain = tuple(sorted(plain, key=lambda form: (-len(form), form)))
        self._based = tuple(sorted({form for one in known for form in _based(one)}))
        self._bytes = tuple(
            form.encode("utf-8", "surrogatepass") for form in (*self._plain, *self._based)
        )

    def hide(self, text: str) -> str:
        """Return `text` without the secrets."""
        for form in self._plain:
            text = text.replace(form, HIDDEN)
        for form in self._based:
            if form in text:
                text = re.sub(f"[\\w+/=-]*{re.escape(form)}[\\w+/=-]*", HIDDEN, text)
        return text

    def are_in(self, data: bytes) -> bool:
        """Return whether a secret is in `data`."""
        return any(form in data for form in self._bytes)


def forms(secret: str) -> list[str]:
    """Return the plain, JSON, URL and hex forms of a secret."""
    found = [secret, json.dumps(secret, ensure_ascii=False)[1:-1], json.dumps(secret)[1:-1]]
    if _SHORTEST <= len(secret) <= _LONGEST:
        data = secret.encode("utf-8", "surrogatepass")
        found += [quote(data, safe=""), quote(data), quote_plus(data)]
        found += [data.hex(), data.hex().upper(), data.hex(" "), data.hex(" ").upper()]
    return found


def _based(secret: str) -> list[str]:
    """Return the parts of the secret's base64 forms that neighbouring bytes cannot change."""
    data = secret.encode("utf-8", "surrogatepass")
    found: list[str] = []
    for first in range(3):
        whole = data[first : first + (len(data) - first) // 3 * 3]
        if _SHORTEST <= len(whole) <= _LONGEST:
            text = base64.b64encode(whole).decode()
            found += [text, text.translate(_FOR_URLS)]
    return found


_FOR_URLS = str.maketrans("+/", "-_")

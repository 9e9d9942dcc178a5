"""YAML files with sign-in options; every error message contains the line number.

Layer 4. The file contains no secrets. It names the files that contain the secrets; those files must
not be accessible to all users.
"""

import os
import stat
from collections.abc import Collection
from pathlib import Path
from typing import Any, Final

from urc.problems import ProblemsError
from urc.source import Document, DocumentLimits, read_document
from urc.source import Path as DocumentPath

__all__ = ["OptionsFile", "is_loopback_host"]

_LIMITS: Final = DocumentLimits(size_bytes=65536)
_LONGEST: Final = 2000
_LONGEST_SECRET: Final = 4096
_READABLE_BY_OTHERS: Final = stat.S_IRWXO


class OptionsFile:
    """The content of a YAML file with sign-in options, and the positions of its values."""

    def __init__(self, file: str, keys: Collection[str]) -> None:
        """Read the file.

        Args:
            file: the file's path.
            keys: all keys that the file may contain.

        Raises:
            ProblemsError: the file cannot be read, or is not a mapping with these keys.
        """
        self._document: Document = read_document(file, _LIMITS)
        self.folder = Path(file).resolve().parent
        """The file's folder; paths of other files are relative to this folder."""
        data = self._document.data
        if not isinstance(data, dict):
            raise self.fault((), f"expected the keys: {', '.join(keys)}", "wrong-type")
        self.data: dict[str, Any] = data
        self.check_keys((), data, keys)

    def fault(
        self, path: DocumentPath, message: str, code: str = "wrong-value", *, is_key: bool = False
    ) -> ProblemsError:
        """Return the error for the value or key at `path`, with its line number."""
        return ProblemsError([self._document.problem(path, code, message, key=is_key)])

    def check_keys(self, path: DocumentPath, data: Collection[str], keys: Collection[str]) -> None:
        """Raise `ProblemsError` for an unknown key."""
        for key in data:
            if key not in keys:
                text = f"unknown key {key!r}; expected one of: {', '.join(keys)}"
                raise self.fault((*path, key), text, "unknown-key", is_key=True)

    def text(self, key: str, default: str | None = None) -> str:
        """Return a key's text; raise `ProblemsError` for a wrong type or a missing required key.

        Args:
            key: the key.
            default: value if the key is missing; None if the key is required.
        """
        return self.text_in((), self.data, key, default)

    def text_in(
        self, path: DocumentPath, data: dict[str, Any], key: str, default: str | None = None
    ) -> str:
        """Return a key's text in the mapping `data` at `path`; see also `text`."""
        value = data.get(key)
        if value is None and default is not None:
            return default
        if value is None:
            raise self.fault(path, f"{key!r} is missing", "missing-key")
        if not isinstance(value, str) or not 0 < len(value) <= _LONGEST:
            raise self.fault((*path, key), f"expected text, found {value!r}", "wrong-type")
        return value

    def list_of(self, key: str) -> list[Any]:
        """Return a key's list, or [] for a missing key; raise `ProblemsError` for a wrong type."""
        value = self.data.get(key)
        if value is None:
            return []
        if not isinstance(value, list):
            raise self.fault((key,), "expected a list", "wrong-type")
        return value

    def secret(self, key: str, *, shortest: int = 1) -> str:
        """Return a secret file's content without surrounding spaces; "" if the key is missing.

        Args:
            key: the key that contains the file's path.
            shortest: minimum length of the secret, in characters.

        Raises:
            ProblemsError: the file cannot be read, is too short or too long, or is accessible to
                all users of this machine.
        """
        if self.data.get(key) is None:
            return ""
        file = self.folder / self.text(key)
        try:
            with file.open("rb") as opened:
                mode = os.fstat(opened.fileno()).st_mode
                content = opened.read(_LONGEST_SECRET + 1)
        except OSError as error:
            raise self.fault((key,), f"{file} cannot be read: {error.strerror}") from None
        if os.name == "posix" and mode & _READABLE_BY_OTHERS:
            raise self.fault(
                (key,), f"all users of this machine can access {file}; run: chmod o= {file}"
            )
        secret = content.decode("utf-8", "replace").strip()
        if not shortest <= len(secret) <= _LONGEST_SECRET:
            raise self.fault(
                (key,), f"expected {shortest} to {_LONGEST_SECRET} characters in {file},"
                f" found {len(secret)}",
            )  # fmt: skip
        return secret


def is_loopback_host(host: str) -> bool:
    """Return whether a URL's host is this machine, where plain HTTP is private."""
    # The list is fixed, because any other name is resolved at each request, and its address could
    # change.
    return host in ("127.0.0.1", "localhost", "::1", "[::1]")

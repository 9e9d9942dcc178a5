"""A repository's upload tokens. Only digests of the tokens are stored."""

import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Final

import msgspec

from urc.packages import atomic_files
from urc.packages.names import FOLDERS, PackageError, PackageId
from urc.packages.package import sha256

__all__ = ["UploadToken", "UploadTokens", "new_token", "read_token"]

_BYTES: Final = 1 << 20
_MOST: Final = 1000
_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_MAY: Final = re.compile(rf"(?:({'|'.join(FOLDERS)})/(?:[a-z][a-z0-9-]{{0,63}})?\*?|\*)")
_TOKEN: Final = re.compile(r"urc_[A-Za-z0-9_-]{43}")


class UploadToken(msgspec.Struct, frozen=True):
    """An upload token as stored: its name, its digest, and the packages that it may publish."""

    name: str
    sha256: Annotated[str, msgspec.Meta(pattern=r"\A[0-9a-f]{64}\Z")]
    """Digest of the token. A fast hash is sufficient, because a token has 256 random bits."""
    may: tuple[str, ...]
    """Packages that the token may publish: ``drivers/puppet``, ``drivers/puppet*``, ``widgets/*``
    or ``*``."""

    def allows(self, key: PackageId) -> bool:
        """Return whether the token allows uploads of a package."""
        text = str(key)
        return any(
            text.startswith(one[:-1]) if one.endswith("*") else text == one for one in self.may
        )


class _TokenFile(msgspec.Struct, frozen=True):
    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    tokens: tuple[UploadToken, ...]


class UploadTokens:
    """The upload tokens in a file. Each call reads the file, so a removal takes effect at once."""

    def __init__(self, file: Path) -> None:
        self.file = file

    def all(self) -> tuple[UploadToken, ...]:
        """Return the stored tokens; raise `PackageError` for an unreadable file."""
        try:
            with open(self.file, "rb") as opened:
                return msgspec.json.decode(opened.read(_BYTES), type=_TokenFile).tokens
        except FileNotFoundError:
            return ()
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise PackageError(f"{self.file}: this is not a token file: {error}") from None
        except OSError as error:
            raise PackageError(f"{self.file}: {error.strerror or error}") from None

    def find(self, text: str) -> UploadToken | None:
        """Return the stored token with this text, or None. The comparison takes constant time."""
        digest = sha256(text.encode())
        found = None
        for token in self.all():
            if secrets.compare_digest(token.sha256, digest):
                found = token
        return found

    def add(self, name: str, may: tuple[str, ...]) -> str:
        """Generate a token and return its text. Only the token's digest is stored.

        Raises:
            PackageError: the name is in use or invalid, `may` contains an invalid pattern, or too
                many tokens are stored.
        """
        if not _NAME.fullmatch(name):
            raise PackageError(f"{name!r}: expected a name of letters, digits, '-', '_' and '.'")
        for one in may:
            if not _MAY.fullmatch(one):
                raise PackageError(
                    f"{one!r} is not a package pattern;"
                    " expected drivers/puppet, drivers/puppet*, widgets/* or *"
                )
        text = new_token()
        with self._changing() as known:
            if any(token.name == name for token in known):
                raise PackageError(f"{self.file}: a token named {name!r} already exists")
            if len(known) >= _MOST:
                raise PackageError(f"{self.file}: at most {_MOST} tokens can be stored")
            self._write((*known, UploadToken(name, sha256(text.encode()), may)))
        return text

    def remove(self, name: str) -> None:
        """Remove a token; raise `PackageError` for an unknown name."""
        with self._changing() as known:
            if all(token.name != name for token in known):
                names = ", ".join(token.name for token in known) or "none"
                raise PackageError(f"{self.file}: unknown token {name!r}; expected one of: {names}")
            self._write(tuple(token for token in known if token.name != name))

    @contextmanager
    def _changing(self) -> Iterator[tuple[UploadToken, ...]]:
        with atomic_files.exclusive(self.file.with_name(f".{self.file.name}.changing")):
            yield self.all()

    def _write(self, tokens: tuple[UploadToken, ...]) -> None:
        data = msgspec.json.format(msgspec.json.encode(_TokenFile(1, tokens)), indent=1)
        atomic_files.put_file(self.file, data + b"\n", self.file.resolve().parent)


def new_token() -> str:
    """Return the text of a new token, which contains 256 random bits."""
    return f"urc_{secrets.token_urlsafe(32)}"


def read_token(file: Path) -> str:
    """Return the text of the token in a file; raise `PackageError` on failure."""
    try:
        with open(file, "rb") as opened:
            text = opened.read(1024).decode("utf-8", "replace").strip()
    except OSError as error:
        raise PackageError(f"{file}: {error.strerror or error}") from None
    if not _TOKEN.fullmatch(text):
        raise PackageError(f"{file}: expected one token, as printed by 'urc repo token add'")
    return text

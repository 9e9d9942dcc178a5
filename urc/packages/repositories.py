"""The repositories that this user knows, and what they said last."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Final

import msgspec

from urc.packages import disk
from urc.packages.index import INDEX_BYTES, Entry, Index, read_index
from urc.packages.names import PackageError
from urc.packages.package import sha256
from urc.packages.remote import fetch_archive, fetch_index, repository_url

__all__ = ["Repositories", "Repository"]

_MOST: Final = 32
_LIST_BYTES: Final = 1 << 20


class _Known(msgspec.Struct, frozen=True):
    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    urls: tuple[str, ...]


class _Tag(msgspec.Struct, frozen=True):
    etag: str
    sha256: str
    """Of the index that it belongs to."""


class Repository:
    """One repository. What it said last is kept, and used where it cannot be reached."""

    def __init__(self, url: str, folder: Path, complain: Callable[[str], None]) -> None:
        self.name = url
        self._complain = complain
        self._folder = folder
        stem = hashlib.sha256(url.encode()).hexdigest()[:32]
        self._index = folder / f"{stem}.index.json"
        self._tag = folder / f"{stem}.etag.json"

    def entries(self) -> tuple[Entry, ...]:
        """Return what it has, or what it had when it was last reached."""
        try:
            return self.refresh().packages
        except PackageError as error:
            kept = self._kept()
            if kept is None:
                raise
            self._complain(f"{error}; what it said last is used")
            return read_index(kept, str(self._index)).packages

    def refresh(self) -> Index:
        """Ask the repository; raise `PackageError` when it does not answer."""
        kept = self._kept()
        answer = fetch_index(self.name, self._etag(kept) if kept is not None else "")
        if answer.status == 304 and kept is not None:
            return read_index(kept, self.name)
        index = read_index(answer.body, self.name)
        work = self._folder / "work"
        disk.put_file(self._index, answer.body, work)
        tag = msgspec.json.encode(_Tag(answer.etag, sha256(answer.body)))
        disk.put_file(self._tag, tag, work)
        return index

    def fetch(self, entry: Entry) -> bytes:
        """Return an archive of it."""
        return fetch_archive(self.name, entry)

    def forget(self) -> None:
        """Drop what it said last."""
        self._index.unlink(missing_ok=True)
        self._tag.unlink(missing_ok=True)

    def _kept(self) -> bytes | None:
        return _content(self._index, INDEX_BYTES)

    def _etag(self, kept: bytes) -> str:
        """Return the tag of what is kept, or "" when it belongs to something else."""
        try:
            tag = msgspec.json.decode(_content(self._tag, 4096) or b"", type=_Tag)
        except msgspec.DecodeError:
            return ""
        return tag.etag if tag.sha256 == sha256(kept) else ""


class Repositories:
    """The list of them, in the order in which they are asked."""

    def __init__(self, folder: Path, complain: Callable[[str], None]) -> None:
        self._folder = folder / "repositories"
        self._file = self._folder / "list.json"
        self._complain = complain

    def all(self) -> list[Repository]:
        """Return those that were added, the first first."""
        return [self._repository(url) for url in self._urls()]

    def add(self, text: str) -> tuple[str, Index]:
        """Remember a repository that answers; return its address, and what it has."""
        url = repository_url(text)
        index = self._repository(url).refresh()
        with disk.exclusive(self._folder / "changing"):
            urls = self._urls()
            if len(urls) >= _MOST:
                raise PackageError(f"at most {_MOST} repositories can be remembered")
            if url not in urls:
                self._write((*urls, url))
        return url, index

    def remove(self, text: str) -> str:
        """Forget a repository; what was installed from it stays."""
        url = repository_url(text)
        with disk.exclusive(self._folder / "changing"):
            urls = self._urls()
            if url not in urls:
                known = ", ".join(urls) or "none"
                raise PackageError(f"{url} was never added; these were: {known}")
            self._write(tuple(one for one in urls if one != url))
        self._repository(url).forget()
        return url

    def _repository(self, url: str) -> Repository:
        return Repository(url, self._folder, self._complain)

    def _urls(self) -> tuple[str, ...]:
        data = _content(self._file, _LIST_BYTES)
        if data is None:
            return ()
        try:
            return msgspec.json.decode(data, type=_Known).urls
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise PackageError(f"{self._file}: this file is damaged: {error}") from None

    def _write(self, urls: tuple[str, ...]) -> None:
        data = msgspec.json.encode(_Known(1, urls))
        disk.put_file(self._file, data + b"\n", self._folder / "work")


def _content(file: Path, most: int) -> bytes | None:
    try:
        with open(file, "rb") as opened:
            return opened.read(most + 1)
    except FileNotFoundError:
        return None

"""The repositories that this user knows, and what they said last."""

import hashlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Final

import msgspec

from urc.packages import disk
from urc.packages.changes import (
    HEAD,
    HEAD_BYTES,
    IndexChange,
    applied,
    change_file,
    read_change,
    read_head,
)
from urc.packages.index import INDEX, INDEX_BYTES, Entry, Index, read_index
from urc.packages.names import PackageError
from urc.packages.package import sha256
from urc.packages.remote import ask, fetch_archive, repository_url

__all__ = ["Repositories", "Repository"]

_MOST: Final = 32
_STEPS_MOST: Final = 64
"""Changes that are asked for one by one; where more is new, the whole index is."""
_LIST_BYTES: Final = 1 << 20


class _Known(msgspec.Struct, frozen=True):
    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    urls: tuple[str, ...]


class _Tags(msgspec.Struct, frozen=True):
    sha256: str
    """Of the index that they belong to."""
    index: str = ""
    """ETag of the whole index; "" when it was put together from changes."""
    head: str = ""


class Repository:
    """One repository. What it said last is kept, and used where it cannot be reached.

    Its number only ever grows: one that goes back is not believed, and what it said last is used.
    """

    def __init__(self, url: str, folder: Path, complain: Callable[[str], None]) -> None:
        self.name = url
        self._complain = complain
        self._folder = folder
        stem = hashlib.sha256(url.encode()).hexdigest()[:32]
        self._index = folder / f"{stem}.index.json"
        self._tags = folder / f"{stem}.tags.json"

    def entries(self) -> tuple[Entry, ...]:
        """Return what it has, or what it had when it was last reached."""
        try:
            return self.refresh().packages
        except PackageError as error:
            kept = self._kept()
            if kept is None:
                raise
            self._complain(f"{error}; what it said last is used")
            return kept[0].packages

    def refresh(self) -> Index:
        """Ask the repository for what is new, and return all that it has.

        Raises:
            PackageError: it does not answer, sends something else, or goes back.
        """
        kept = self._kept()
        if kept is None:
            return self._whole(None, _Tags(""))
        index, tags = kept
        answer = ask(self.name + HEAD, HEAD_BYTES, tags.head, may_lack=True)
        if answer.status == 304:
            return index
        try:
            head = read_head(answer.body, self.name + HEAD)
            if not index.number <= head.number <= index.number + _STEPS_MOST:
                return self._whole(index, tags)
            new = applied(index, self._changes(index.number, head.number))
            if sha256(new.to_bytes()) != head.sha256:
                return self._whole(index, tags)
        except PackageError:  # there is no head, or a change is missing or damaged
            return self._whole(index, tags)
        etag = tags.index if head.number == index.number else ""
        self._keep(new, new.to_bytes(), _Tags(head.sha256, etag, answer.etag))
        return new

    def _changes(self, first: int, last: int) -> Iterator[IndexChange]:
        """Yield what is new, all of it together at most as large as an index may be."""
        left = INDEX_BYTES
        for number in range(first + 1, last + 1):
            address = self.name + change_file(number)
            body = ask(address, left).body
            left -= len(body)
            yield read_change(body, address)

    def _whole(self, kept: Index | None, tags: _Tags) -> Index:
        """Take the whole index; raise `PackageError` when it is older than what is known."""
        address = self.name + INDEX
        answer = ask(address, INDEX_BYTES, tags.index if kept else "")
        if answer.status == 304 and kept is not None:
            return kept
        index = read_index(answer.body, self.name)
        if kept is not None and (
            index.number < kept.number or (index.number == kept.number > 0 and index != kept)
        ):
            raise PackageError(
                f"{address}: it went back from number {kept.number} to {index.number}, or changed"
                f" without a new one; if its keeper says that this is right,"
                f" 'urc repo remove {self.name}' and add it again"
            )
        self._keep(index, answer.body, _Tags(sha256(answer.body), answer.etag))
        return index

    def fetch(self, entry: Entry) -> bytes:
        """Return an archive of it."""
        return fetch_archive(self.name, entry)

    def forget(self) -> None:
        """Drop what it said last."""
        self._index.unlink(missing_ok=True)
        self._tags.unlink(missing_ok=True)

    def _keep(self, index: Index, data: bytes, tags: _Tags) -> None:
        work = self._folder / "work"
        disk.put_file(self._index, data, work)
        disk.put_file(self._tags, msgspec.json.encode(tags), work)

    def _kept(self) -> tuple[Index, _Tags] | None:
        """Return what it said last, with the tags if they belong to it; None: it said nothing."""
        data = _content(self._index, INDEX_BYTES)
        if data is None:
            return None
        try:
            index = read_index(data, str(self._index))
        except PackageError as error:
            self._complain(f"{error}; it is asked for anew")
            return None
        try:
            tags = msgspec.json.decode(_content(self._tags, 4096) or b"", type=_Tags)
        except (msgspec.DecodeError, UnicodeDecodeError):
            tags = _Tags("")
        return index, tags if tags.sha256 == sha256(data) else _Tags("")


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

"""The user's repositories and their last known indexes."""

import hashlib
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Final

import msgspec

from urc.packages import atomic_files
from urc.packages.block_store import BlockStore
from urc.packages.http_repository import HttpResponse, ask, fetch_archive, repository_url
from urc.packages.index import INDEX, INDEX_BYTES, Index, IndexEntry, read_index
from urc.packages.index_head import HEAD, HEAD_BYTES, IndexHead, read_head
from urc.packages.names import PackageError
from urc.packages.package import sha256
from urc.packages.trust import PinnedKey

__all__ = ["Repositories", "Repository"]

_MOST: Final = 32
_LIST_BYTES: Final = 1 << 20
_TRIES: Final = 2
"""Number of attempts to read a head and its index, between which the repository may change."""


class _RepositoriesFile(msgspec.Struct, frozen=True):
    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    urls: tuple[str, ...]


class _Tags(msgspec.Struct, frozen=True):
    sha256: str
    """Digest of the index that the stored ETags belong to."""
    index: str = ""
    """ETag that the server sent with the index; "" if unknown."""
    head: str = ""
    said: IndexHead | None = None
    """The verified head; None if no head matches the index."""


class Repository:
    """A repository.

    The last index is stored for use while the repository is unreachable.

    The index number never decreases. If an index has a lower number, URC reports an error and uses
    the stored index. The first signing key is pinned. An index that is unsigned or signed with
    another key is rejected.
    """

    def __init__(
        self,
        url: str,
        folder: Path,
        complain: Callable[[str], None],
        now: Callable[[], float] = time.time,
    ) -> None:
        self.name = url
        self._complain = complain
        self._folder = folder
        stem = hashlib.sha256(url.encode()).hexdigest()[:32]
        self._index = folder / f"{stem}.index.json"
        self._tags = folder / f"{stem}.tags.json"
        self._trust = PinnedKey(url, folder / f"{stem}.key.json", now)
        self._blocks = BlockStore(folder.parent)

    @property
    def keeper(self) -> str:
        """Name and fingerprint of the index's signer; "" for an unsigned index."""
        return self._trust.keeper

    @property
    def key(self) -> str:
        """Public key of the index's signer; "" for an unsigned index."""
        by = self._trust.signer
        return by.key if by is not None else ""

    def known(self) -> tuple[IndexEntry, ...]:
        """Return the stored index's entries without a request; () if no index is stored."""
        kept = self._kept()
        return kept[0].packages if kept is not None else ()

    def entries(self) -> tuple[IndexEntry, ...]:
        """Return the current entries, or the stored entries if the request fails.

        Raises:
            PackageError: no index is stored, or the stored index has expired.
        """
        try:
            return self.refresh().packages
        except PackageError as error:
            kept = self._kept()
            if kept is None:
                raise
            self._trust.check(kept[1].said)
            self._complain(f"{error}; its last stored index is used")
            return kept[0].packages

    def refresh(self) -> Index:
        """Request the newest index and return it.

        Raises:
            PackageError: the repository is unreachable, or its index is not accepted. An accepted
                index is valid, not expired, not older than the stored index, and signed by the
                pinned key.
        """
        for _ in range(_TRIES):
            index = self._asked()
            if index is not None:
                self._keep_blocks(index)
                return index
        raise PackageError(
            f"{self.name}{INDEX}: the index does not match its digest in {HEAD}; try again"
        )

    def _keep_blocks(self, index: Index) -> None:
        """Store the block list of an accepted index; an unsigned index's list is ignored."""
        listed, by = index.block_list, self._trust.signer
        if listed is None or by is None:
            return
        try:
            self._blocks.keep(by, index.number, listed, self.name)
        except PackageError as error:
            self._complain(str(error))

    def _asked(self) -> Index | None:
        """Request the head and the index once; return None if a signed head names another index."""
        kept = self._kept()
        said = kept[1].said if kept is not None else None
        etag = kept[1].head if kept is not None and said is not None else ""
        answer = ask(self.name + HEAD, HEAD_BYTES, etag, may_lack=True)
        head = said if answer.status == 304 else _head(answer, self.name)
        self._trust.check(head)
        if kept is not None and answer.status == 304:
            return kept[0]
        if kept is not None and head is not None:
            index, tags = kept
            if (head.number, head.sha256) == (index.number, tags.sha256):  # only re-signed
                self._store(_Tags(tags.sha256, tags.index, answer.etag, head))
                return index
        return self._whole(kept, head, answer.etag)

    def _whole(
        self, kept: tuple[Index, _Tags] | None, head: IndexHead | None, etag: str
    ) -> Index | None:
        """Request the whole index; return None if it does not match its signed head.

        Raises:
            PackageError: the index is older than the stored index.
        """
        address = self.name + INDEX
        answer = ask(address, INDEX_BYTES, kept[1].index if kept is not None else "")
        if answer.status == 304 and kept is not None:
            index, digest = kept[0], kept[1].sha256
        else:
            index, digest = read_index(answer.body, self.name), sha256(answer.body)
        is_named = head is not None and head.sha256 == digest
        if head is not None and head.signed and not is_named:
            return None
        self._check_number(address, index, kept)
        if answer.status != 304:
            tags = _Tags(digest, answer.etag, etag if is_named else "", head if is_named else None)
            self._store(tags, answer.body)
        return index

    def _check_number(self, address: str, index: Index, kept: tuple[Index, _Tags] | None) -> None:
        number = max(self._trust.number, kept[0].number if kept is not None else 0)
        is_other = kept is not None and index.number == kept[0].number > 0 and index != kept[0]
        if index.number < number or is_other:
            raise PackageError(
                f"{address}: the index number decreased from {number} to {index.number}, or the"
                f" index changed without a new number; if the maintainer confirms the change, run"
                f" 'urc repo remove {self.name}' and add the repository again"
            )

    def fetch(self, entry: IndexEntry) -> bytes:
        """Download the archive of an index entry from the repository."""
        return fetch_archive(self.name, entry)

    def forget(self) -> None:
        """Delete the stored index and the pinned key."""
        self._index.unlink(missing_ok=True)
        self._tags.unlink(missing_ok=True)
        self._trust.forget()

    def _store(self, tags: _Tags, data: bytes | None = None) -> None:
        """Store the ETags, and the index if `data` is given."""
        work = self._folder / "work"
        if tags.said is not None:
            self._trust.pin(tags.said, work)
        if data is not None:
            atomic_files.put_file(self._index, data, work)
        atomic_files.put_file(self._tags, msgspec.json.encode(tags), work)

    def _kept(self) -> tuple[Index, _Tags] | None:
        """Return the stored index with its ETags, or None if no valid index is stored.

        If the stored ETags belong to another index, the returned ETags are empty.
        """
        data = _content(self._index, INDEX_BYTES)
        if data is None:
            return None
        try:
            index = read_index(data, str(self._index))
        except PackageError as error:
            self._complain(f"{error}; the index will be downloaded again")
            return None
        try:
            tags = msgspec.json.decode(_content(self._tags, 4096) or b"", type=_Tags)
        except (msgspec.DecodeError, UnicodeDecodeError):
            tags = _Tags("")
        return index, tags if tags.sha256 == sha256(data) else _Tags("")


class Repositories:
    """The user's repositories, in the order in which they are queried."""

    def __init__(self, folder: Path, complain: Callable[[str], None]) -> None:
        self._folder = folder / "repositories"
        self._file = self._folder / "list.json"
        self._complain = complain

    def all(self) -> list[Repository]:
        """Return the repositories, in the order in which the user added them."""
        return [self._repository(url) for url in self._urls()]

    def add(self, text: str) -> tuple[str, Index]:
        """Add a reachable repository; return its URL and its index."""
        url = repository_url(text)
        index = self._repository(url).refresh()
        with atomic_files.exclusive(self._folder / "changing"):
            urls = self._urls()
            if len(urls) >= _MOST:
                raise PackageError(f"at most {_MOST} repositories can be added")
            if url not in urls:
                self._write((*urls, url))
        return url, index

    def remove(self, text: str) -> str:
        """Remove a repository; packages installed from it remain installed."""
        url = repository_url(text)
        with atomic_files.exclusive(self._folder / "changing"):
            urls = self._urls()
            if url not in urls:
                known = ", ".join(urls) or "none"
                raise PackageError(f"{url} was never added; expected one of: {known}")
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
            return msgspec.json.decode(data, type=_RepositoriesFile).urls
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise PackageError(f"{self._file}: this file is damaged: {error}") from None

    def _write(self, urls: tuple[str, ...]) -> None:
        data = msgspec.json.encode(_RepositoriesFile(1, urls))
        atomic_files.put_file(self._file, data + b"\n", self._folder / "work")


def _head(answer: HttpResponse, url: str) -> IndexHead | None:
    """Return the head in a response; None for a missing or damaged head."""
    with suppress(PackageError):
        return read_head(answer.body, url + HEAD)
    return None


def _content(file: Path, most: int) -> bytes | None:
    try:
        with open(file, "rb") as opened:
            return opened.read(most + 1)
    except FileNotFoundError:
        return None

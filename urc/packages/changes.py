"""An index that grows: how a keeper writes it, and how a client takes only what is new.

    index.json              all that there is, with a number that only ever grows
    index/head.json         the number, and the digest of `index.json`: what is asked for first,
                            and what the keeper signs, see `head`
    index/changes-12.json   what made number 12 out of number 11; never changed afterwards

All of them are plain files, so a static web server gives them out as well. A client that has number
11 reads `changes-12.json`, and has `index.json` to the last byte: the digest tells. Else it takes
the whole one.
"""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import msgspec

from urc.packages import disk
from urc.packages.head import HEAD, HEAD_BYTES, Head, Seal, next_head, read_head
from urc.packages.index import INDEX, INDEX_BYTES, Entry, Index, check_entries, in_order, read_index
from urc.packages.names import PackageError
from urc.packages.package import sha256

__all__ = [
    "IndexChange",
    "applied",
    "change_file",
    "head_in",
    "read_change",
    "write_index",
]

_Number = Annotated[int, msgspec.Meta(ge=0, le=1 << 53)]


class IndexChange(msgspec.Struct, frozen=True, omit_defaults=True):
    """What makes one number of an index out of the one before."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    number: _Number
    """Of the index that comes of it."""
    name: Annotated[str, msgspec.Meta(max_length=500)]
    """What the repository is called from now on."""
    put: tuple[Entry, ...] = ()
    """What is new, or has something new to say, such as a signature."""
    gone: tuple[str, ...] = ()
    """Files of archives that are listed no more."""


def change_file(number: int) -> str:
    """Return where the change that made a number is, relative to the index."""
    return f"index/changes-{number}.json"


def read_change(data: bytes, where: str) -> IndexChange:
    """Return a change that came from outside; raise `PackageError`."""
    try:
        change = msgspec.json.decode(data, type=IndexChange)
        check_entries(change.put)
    except (msgspec.DecodeError, PackageError, RecursionError, UnicodeDecodeError) as error:
        raise PackageError(f"{where}: this is no change of an index: {error}") from None
    return change


def applied(index: Index, changes: Iterable[IndexChange]) -> Index:
    """Return what some changes in a row make of an index.

    Raises:
        PackageError: one is not the next.
    """
    entries = {entry.file: entry for entry in index.packages}
    number, name = index.number, index.name
    for change in changes:
        if change.number != number + 1:
            raise PackageError(f"change {change.number} of an index does not follow {number}")
        number, name = change.number, change.name
        for file in change.gone:
            entries.pop(file, None)
        entries |= {entry.file: entry for entry in change.put}
    return Index(1, name, in_order(entries.values()), number)


def write_index(
    folder: Path, name: str, entries: Sequence[Entry], work: Path, seal: Seal | None = None
) -> Index:
    """Write what a repository has: its change first, then the whole, then the head.

    Whenever this ends, every file that can be asked for is whole, and the next call mends the rest.

    Args:
        folder: the repository; nobody else changes it meanwhile.
        name: what it is called.
        entries: all that there is.
        work: for what is not whole yet.
        seal: the keeper's, who answers for the index with it.

    Raises:
        PackageError: the index is signed with a key that is not at hand; nothing has changed.
        OSError: the disk is full, for example.
    """
    before, number = _before(folder)
    index = Index(1, name, in_order(entries), number)
    is_new = before is None or (before.name, before.packages) != (index.name, index.packages)
    if is_new:
        number += 1
        index = Index(1, name, index.packages, number)
    data = index.to_bytes()
    head = next_head(head_in(folder), number, sha256(data), seal).to_bytes()
    if is_new:
        change = _difference(before or Index(1, "", ()), index)
        disk.put_file(folder / change_file(number), msgspec.json.encode(change) + b"\n", work)
        disk.put_file(folder / INDEX, data, work)
    if _content(folder / HEAD, HEAD_BYTES) != head:
        disk.put_file(folder / HEAD, head, work)
    return index


def _difference(before: Index, after: Index) -> IndexChange:
    old = {entry.file: entry for entry in before.packages}
    new = {entry.file: entry for entry in after.packages}
    put = tuple(entry for file, entry in new.items() if old.get(file) != entry)
    gone = tuple(file for file in old if file not in new)
    return IndexChange(1, after.number, after.name, put, gone)


def _before(folder: Path) -> tuple[Index | None, int]:
    """Return the index that is there, if it is sound, and the highest number that was given out."""
    data = _content(folder / INDEX, INDEX_BYTES + 1)
    try:
        if data is not None:
            index = read_index(data, INDEX)
            # One that was written otherwise gets another number: a number means certain bytes.
            return (index if data == index.to_bytes() else None), index.number
    except PackageError:
        pass  # damaged: it is made anew, with a number that nobody has seen
    numbers = [0]
    for file in (folder / "index").glob("changes-*.json"):
        digits = file.stem.removeprefix("changes-")
        numbers += [int(digits)] if digits.isdecimal() and len(digits) < 16 else []
    head = head_in(folder)
    return None, max(*numbers, head.number if head is not None else 0)


def head_in(folder: Path) -> Head | None:
    """Return the head that stands in a repository's folder; None: there is none that is sound."""
    with suppress(PackageError):
        return read_head(_content(folder / HEAD, HEAD_BYTES) or b"", HEAD)
    return None


def _content(file: Path, most: int) -> bytes | None:
    try:
        with open(file, "rb") as opened:
            return opened.read(most)
    except FileNotFoundError:
        return None

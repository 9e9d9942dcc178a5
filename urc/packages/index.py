"""``index.json``: a repository's list of packages, in a plain file for any web server."""

from collections.abc import Iterable, Sequence
from typing import Annotated, Final

import msgspec

from urc.packages.archive import PACKAGE
from urc.packages.blocks import BlockList
from urc.packages.names import KINDS, NAME, PackageError, PackageId, parse_key
from urc.packages.package import Package
from urc.packages.signature import Signature
from urc.packages.version_notes import Notes, Provenance
from urc.packages.versions import Version, parse_range, parse_version

__all__ = [
    "INDEX",
    "INDEX_BYTES",
    "IndexEntry",
    "Index",
    "check_entries",
    "entry_of",
    "in_order",
    "read_index",
    "search",
]

INDEX: Final = "index.json"
INDEX_BYTES: Final = 64 << 20
_Text = Annotated[str, msgspec.Meta(max_length=500)]


class IndexEntry(msgspec.Struct, frozen=True):
    """One version of a package, as listed in an index."""

    kind: Annotated[str, msgspec.Meta(pattern=rf"\A({'|'.join(KINDS)})\Z")]
    name: Annotated[str, msgspec.Meta(pattern=rf"\A{NAME.pattern}\Z")]
    version: Annotated[str, msgspec.Meta(max_length=64)]
    sha256: Annotated[str, msgspec.Meta(pattern=r"\A[0-9a-f]{64}\Z")]
    size: Annotated[int, msgspec.Meta(ge=0, le=PACKAGE.archive_bytes)]
    """Size of the archive, in bytes."""
    language: int = 1
    licence: _Text = ""
    authors: tuple[_Text, ...] = ()
    summary: _Text = ""
    needs: dict[str, _Text] = {}
    signature: Signature | msgspec.UnsetType = msgspec.UNSET
    """Signature, if any."""
    withdrawn: _Text | msgspec.UnsetType = msgspec.UNSET
    """Reason for the withdrawal, if the version was withdrawn."""
    provenance: Provenance | msgspec.UnsetType = msgspec.UNSET
    """Origin, if declared."""

    @property
    def why_withdrawn(self) -> str:
        """Reason for the withdrawal; "" for an available version."""
        return self.withdrawn if isinstance(self.withdrawn, str) else ""

    @property
    def signed(self) -> Signature | None:
        """Signature, or None."""
        return self.signature if isinstance(self.signature, Signature) else None

    @property
    def key(self) -> PackageId:
        """The entry's package."""
        return PackageId(self.kind, self.name)

    @property
    def number(self) -> Version:
        """Comparable version of the package."""
        return parse_version(self.version)

    @property
    def file(self) -> str:
        """Path of the archive, relative to the index."""
        return f"archives/{self.key}/{self.version}.zip"

    def __str__(self) -> str:
        return f"{self.key} {self.version}"


class Index(msgspec.Struct, frozen=True):
    """All package versions in a repository."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    name: _Text
    packages: tuple[IndexEntry, ...]
    number: Annotated[int, msgspec.Meta(ge=0, le=1 << 53)] = 0
    """Number that increases with every change to the repository; 0 in unnumbered indexes."""
    blocks: BlockList | msgspec.UnsetType = msgspec.UNSET
    """Blocked packages. Clients ignore this list unless the index is signed."""

    @property
    def block_list(self) -> BlockList | None:
        """Block list, or None."""
        return self.blocks if isinstance(self.blocks, BlockList) else None

    def to_bytes(self) -> bytes:
        """Return the index file's content; equal indexes have identical bytes."""
        return msgspec.json.format(msgspec.json.encode(self), indent=1) + b"\n"


def entry_of(
    package: Package, signature: Signature | None = None, notes: Notes | None = None
) -> IndexEntry:
    """Return the index entry for a package with its signature and notes."""
    notes = notes or Notes()
    said = package.manifest
    return IndexEntry(
        *said.key,
        version=said.version,
        sha256=package.digest,
        size=len(package.data),
        language=said.language,
        licence=said.licence,
        authors=said.authors,
        summary=said.summary,
        needs=said.needs,
        signature=signature or msgspec.UNSET,
        withdrawn=notes.withdrawn or msgspec.UNSET,
        provenance=notes.provenance or msgspec.UNSET,
    )


def read_index(data: bytes, where: str) -> Index:
    """Return an index from an untrusted source; raise `PackageError` if it is invalid.

    Versions and ranges are validated, so later code can rely on valid values.
    """
    if len(data) > INDEX_BYTES:
        raise PackageError(f"{where}: the index is larger than {INDEX_BYTES >> 20} MiB")
    try:
        index = msgspec.json.decode(data, type=Index)
        check_entries(index.packages)
    except (msgspec.DecodeError, PackageError, RecursionError, UnicodeDecodeError) as error:
        raise PackageError(f"{where}: this is not the index of a repository: {error}") from None
    return index


def in_order(entries: Iterable[IndexEntry]) -> tuple[IndexEntry, ...]:
    """Return the entries sorted by package and version, as in an index."""
    return tuple(sorted(entries, key=lambda entry: (entry.key, entry.number)))


def check_entries(entries: Iterable[IndexEntry]) -> None:
    """Raise `PackageError` for an invalid version, package name or range."""
    versions: set[str] = set()
    needs: set[tuple[str, str]] = set()
    for entry in entries:  # thousands of entries share the same text, so each text is parsed once
        versions.add(entry.version)
        needs.update(entry.needs.items())
    for version in versions:
        parse_version(version)
    for needed, wanted in needs:
        parse_key(needed)
        parse_range(wanted)


def search(entries: Iterable[IndexEntry], words: Sequence[str], kind: str = "") -> list[IndexEntry]:
    """Return the newest version of each package whose entry contains all words.

    Matches in package names precede other matches. Withdrawn versions are omitted.
    """
    wanted = [word.casefold() for word in words]
    found: dict[tuple[str, str], IndexEntry] = {}
    for entry in entries:
        if kind and entry.kind != kind:
            continue
        text = f"{entry.kind} {entry.name} {entry.summary}".casefold()
        if all(word in text for word in wanted):
            other = found.get((entry.kind, entry.name))
            if entry.withdrawn is not msgspec.UNSET:
                continue
            if other is None or other.number < entry.number:
                found[entry.kind, entry.name] = entry
    return sorted(
        found.values(),
        key=lambda entry: (not any(word in entry.name for word in wanted), entry.name, entry.kind),
    )

"""A repository's notes on a version: origin and withdrawal.

Notes are stored in the index and in a small file next to the archive.
"""

import re
from pathlib import Path
from typing import Annotated, Final

import msgspec

from urc.packages import atomic_files
from urc.packages.names import PackageError

__all__ = ["PROVENANCE", "Notes", "Provenance", "notes_beside", "read_notes", "write_notes"]

PROVENANCE: Final = "urc-provenance"
"""Upload header that contains the origin as JSON, in base64."""
_LONGEST: Final = 300
_COMMIT: Final = re.compile("[0-9a-f]{7,64}", re.ASCII)


class Provenance(msgspec.Struct, frozen=True, omit_defaults=True):
    """A package's origin, as declared by its publisher.

    An origin from another repository's index may violate the rules of `check`.
    """

    source: Annotated[str, msgspec.Meta(max_length=_LONGEST)] = ""
    """URL of the source code."""
    commit: Annotated[str, msgspec.Meta(max_length=100)] = ""
    tool: Annotated[str, msgspec.Meta(max_length=100)] = ""
    """Name and version of the packaging program."""

    def check(self) -> None:
        """Raise `PackageError` if the declared origin is invalid."""
        if not self.source.startswith(("https://", "http://", "ssh://")):
            raise PackageError("expected a source that starts with https://, http:// or ssh://")
        if self.commit and not _COMMIT.fullmatch(self.commit):
            raise PackageError("expected a commit of 7 to 64 lower-case hex digits")
        if not (self.source + self.tool).isprintable():
            raise PackageError("expected text on one line")

    def __str__(self) -> str:
        at = f" at {self.commit}" if self.commit else ""
        by = f" by {self.tool}" if self.tool else ""
        return f"made from {self.source or 'an unknown source'}{at}{by}"


class Notes(msgspec.Struct, frozen=True, omit_defaults=True):
    """A repository's notes on one version of a package."""

    withdrawn: Annotated[str, msgspec.Meta(max_length=_LONGEST)] = ""
    """Reason for the withdrawal; "" for an available version."""
    provenance: Provenance | None = None

    def __post_init__(self) -> None:
        """Reject a reason for withdrawal that contains hidden characters."""
        if not self.withdrawn.isprintable():
            raise ValueError("expected a reason on one line")


def notes_beside(archive: Path) -> Path:
    """Return the path of the notes file next to an archive."""
    return archive.with_suffix(".json")


def read_notes(archive: Path) -> Notes:
    """Return the notes on an archive; raise `PackageError` for a damaged file."""
    file = notes_beside(archive)
    try:
        with open(file, "rb") as opened:
            return msgspec.json.decode(opened.read(8192), type=Notes)
    except FileNotFoundError:
        return Notes()
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise PackageError(f"{file}: this is not a file of package notes: {error}") from None


def write_notes(archive: Path, notes: Notes, work: Path) -> None:
    """Write the notes on an archive, or delete the file if the notes are empty."""
    if notes == Notes():
        notes_beside(archive).unlink(missing_ok=True)
    else:
        atomic_files.put_file(notes_beside(archive), msgspec.json.encode(notes) + b"\n", work)

"""What a repository says of a version beside the package: where it was made, if it is withdrawn.

It stands in a small file beside the archive, and in the index.
"""

import re
from pathlib import Path
from typing import Annotated, Final

import msgspec

from urc.packages import disk
from urc.packages.names import PackageError

__all__ = ["PROVENANCE", "Notes", "Provenance", "notes_beside", "read_notes", "write_notes"]

PROVENANCE: Final = "urc-provenance"
"""Header of a request that brings a package: where it was made as JSON, in base64."""
_LONGEST: Final = 300
_COMMIT: Final = re.compile("[0-9a-f]{7,64}", re.ASCII)


class Provenance(msgspec.Struct, frozen=True, omit_defaults=True):
    """Where a package was made, as its publisher says.

    In an index that comes from outside it may say more than is known here: see `check`.
    """

    source: Annotated[str, msgspec.Meta(max_length=_LONGEST)] = ""
    """Address of what it was made from."""
    commit: Annotated[str, msgspec.Meta(max_length=100)] = ""
    tool: Annotated[str, msgspec.Meta(max_length=100)] = ""
    """Program that packed it, with its version."""

    def check(self) -> None:
        """Raise `PackageError` for what is not taken from a publisher."""
        if not self.source.startswith(("https://", "http://", "ssh://")):
            raise PackageError("a source begins with https://, http:// or ssh://")
        if self.commit and not _COMMIT.fullmatch(self.commit):
            raise PackageError("a commit is 7 to 64 hex digits, in small letters")
        if not (self.source + self.tool).isprintable():
            raise PackageError("text on one line is expected")

    def __str__(self) -> str:
        at = f" at {self.commit}" if self.commit else ""
        by = f" by {self.tool}" if self.tool else ""
        return f"made from {self.source or 'somewhere'}{at}{by}"


class Notes(msgspec.Struct, frozen=True, omit_defaults=True):
    """All of it, of one version."""

    withdrawn: Annotated[str, msgspec.Meta(max_length=_LONGEST)] = ""
    """Why it is not offered any more; "" while it is."""
    provenance: Provenance | None = None

    def __post_init__(self) -> None:
        """Refuse what would hide something when it is shown."""
        if not self.withdrawn.isprintable():
            raise ValueError("a reason on one line is expected")


def notes_beside(archive: Path) -> Path:
    """Return where the notes about an archive stand."""
    return archive.with_suffix(".json")


def read_notes(archive: Path) -> Notes:
    """Return what stands beside an archive; raise `PackageError` when it is damaged."""
    file = notes_beside(archive)
    try:
        with open(file, "rb") as opened:
            return msgspec.json.decode(opened.read(8192), type=Notes)
    except FileNotFoundError:
        return Notes()
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise PackageError(f"{file}: these are no notes about a package: {error}") from None


def write_notes(archive: Path, notes: Notes, work: Path) -> None:
    """Put notes beside an archive."""
    if notes == Notes():
        notes_beside(archive).unlink(missing_ok=True)
    else:
        disk.put_file(notes_beside(archive), msgspec.json.encode(notes) + b"\n", work)

"""What the operator filled in for a robot, kept over a restart: one small file for each.

The file may hold secrets, so nobody but its owner can read it.
"""

from contextlib import suppress
from pathlib import Path
from typing import Annotated, Final
from urllib.parse import quote

import msgspec

from urc.private_files import put_private
from urc.problems import UrcError

__all__ = ["Kept", "KeptFile"]

_MOST_BYTES: Final = 1 << 20
_Name = Annotated[str, msgspec.Meta(max_length=200)]
_Text = Annotated[str, msgspec.Meta(max_length=4096)]


class Kept(msgspec.Struct, frozen=True):
    """What was chosen for one robot."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)] = 1
    version: _Name = ""
    """Of the installed package; "": the newest."""
    interface: _Name = ""
    """Shown first; "": the document's first."""
    settings: dict[_Name, _Text] = {}
    """Setting → as typed; those that are missing take their defaults."""


class KeptFile:
    """The file of one robot."""

    def __init__(self, folder: Path, name: str) -> None:
        """Choose the file; nothing is read or written yet."""
        self.file = folder / f"{quote(name, safe='')}.json"

    def load(self) -> Kept:
        """Return what is kept; nothing yet is an empty `Kept`.

        Raises:
            UrcError: the file cannot be read, or is damaged.
        """
        try:
            with open(self.file, "rb") as opened:
                data = opened.read(_MOST_BYTES + 1)
            return msgspec.json.decode(data, type=Kept)
        except FileNotFoundError:
            return Kept()
        except OSError as error:
            raise UrcError(f"{self.file}: {error.strerror or error}") from None
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            raise UrcError(f"{self.file}: this file is damaged: {error}") from None

    def save(self, kept: Kept) -> None:
        """Write it: after this the file holds `kept`, even if the power goes; before, what it held.

        Raises:
            UrcError: it cannot be written; then nothing has changed.
        """
        data = msgspec.json.format(msgspec.json.encode(kept, order="sorted"), indent=1) + b"\n"
        try:
            put_private(self.file, data)
        except OSError as error:
            raise UrcError(f"{self.file}: {error.strerror or error}") from None

    def forget(self) -> None:
        """Take the file away, if it is there."""
        with suppress(OSError):
            self.file.unlink(missing_ok=True)

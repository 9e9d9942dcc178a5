"""Files of a fleet in a data folder: reading with a limit, and a lock against other processes.

Layer 4.
"""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

from urc.fleet.names import FleetError
from urc.packages.atomic_files import exclusive
from urc.packages.names import PackageError
from urc.private_files import put_private

__all__ = ["AUTHORITY_FOLDER", "FLEET_FOLDER", "locked", "read", "write"]

FLEET_FOLDER: Final = "fleet"
"""Folder of a membership in the data folder of a site."""
AUTHORITY_FOLDER: Final = "authority"
"""Folder of a fleet's authority in `FLEET_FOLDER`."""


def read(file: Path, at_most: int = 1 << 16) -> bytes:
    """Return the content of a file.

    Args:
        file: the file.
        at_most: maximum size in bytes.

    Raises:
        FileNotFoundError: the file does not exist.
        FleetError: the file cannot be read, or is too large.
    """
    try:
        with file.open("rb") as opened:
            data = opened.read(at_most + 1)
    except FileNotFoundError:
        raise
    except OSError as error:
        hint = "; run URC as the owner of the folder" if isinstance(error, PermissionError) else ""
        raise FleetError(f"{file}: cannot be read: {error.strerror}{hint}") from error
    if len(data) > at_most:
        raise FleetError(f"{file}: expected at most {at_most} bytes")
    return data


def write(file: Path, data: bytes) -> None:
    """Write a private file atomically; raise `FleetError` if this is impossible."""
    try:
        put_private(file, data)
    except OSError as error:
        raise FleetError(f"{file}: cannot be written: {error.strerror}") from error


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Exclude other processes from an existing folder while the context is active.

    Raises:
        FleetError: the folder is unusable, or another process has used it for 10 seconds.
    """
    with ExitStack() as stack:
        try:
            stack.enter_context(exclusive(folder / "lock"))
        except PackageError as error:
            text = f"{folder}: another URC process is using the folder; try again"
            raise FleetError(text) from error
        except OSError as error:
            raise FleetError(f"{folder}: cannot be written: {error.strerror}") from error
        yield

"""The servers of this user on this machine: each leaves a note in the data folder while it runs.

Another program of the same user finds them there, and asks before it moves a robot that one of them
serves. The note of a server that was killed stays behind, and is removed by the next who looks.
"""

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from urc.private_files import put_private

__all__ = ["announced", "servers"]

_FOLDER = "servers"
_MOST_BYTES = 4096
_PRIVATE = 0o700


@contextmanager
def announced(data: Path, url: str) -> Iterator[None]:
    """Leave a note that a server answers at `url`, for as long as the context lasts.

    Where it cannot be written the server runs all the same; then nothing finds it.
    """
    file = data / _FOLDER / f"{os.getpid()}-{url.rstrip('/').rpartition(':')[2]}.json"
    with suppress(OSError):
        put_private(file, json.dumps({"url": url}).encode(), _PRIVATE)
    try:
        yield
    finally:
        with suppress(OSError):
            file.unlink()


def servers(data: Path) -> dict[Path, str]:
    """Return the addresses of those that run, by the file of each note."""
    found: dict[Path, str] = {}
    for file in sorted((data / _FOLDER).glob("*.json")):
        with suppress(OSError, ValueError, KeyError, TypeError):
            if not _is_running(int(file.name.partition("-")[0])):
                file.unlink()
                continue
            with file.open("rb") as note:
                url = json.loads(note.read(_MOST_BYTES))["url"]
            if isinstance(url, str):
                found[file] = url
    return found


def _is_running(pid: int) -> bool:
    """Return whether there is a process of that number, as far as the system tells."""
    if sys.platform == "win32":
        return True  # to ask there is to end it
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True

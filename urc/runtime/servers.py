"""Which dashboards run on this machine, for programs of the same user: their addresses and keys.

Floor 4. Each server keeps one small file of its owner alone, for as long as it runs::

    servers/1a2b3c4d.json    {"address": "http://127.0.0.1:8080/", "key": "…", "pid": 4711}

A program sends the key with each request, as ``Authorization: Bearer …``.
"""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from urc.private_files import put_private

__all__ = ["Server", "announced", "headers", "servers"]

_FOLDER = "servers"
_MOST_BYTES = 4096


class Server(NamedTuple):
    """A dashboard that runs, or did when its machine lost its power."""

    address: str
    """As ``http://127.0.0.1:8080/``."""
    key: str
    """The start key."""
    pid: int
    """Its process."""


def headers(server: Server) -> dict[str, str]:
    """Return what a program sends with each request to `server`."""
    return {"authorization": f"Bearer {server.key}"}


@contextmanager
def announced(data: Path, name: str, server: Server) -> Iterator[None]:
    """Let others of this user find `server` for as long as the context lasts.

    Args:
        data: the folder of URC's data that it uses.
        name: tells it from other servers.
        server: it.

    Raises:
        OSError: the file cannot be written.
    """
    servers(data)  # removes what servers that were killed left behind
    file = data / _FOLDER / f"{name}.json"
    put_private(file, json.dumps(server._asdict()).encode())
    try:
        yield
    finally:
        with suppress(OSError):
            file.unlink()


def servers(data: Path) -> dict[Path, Server]:
    """Return the servers that use the folder `data`, the newest first, by their files.

    The file of one that was killed is removed. Where the system cannot say whether a process runs,
    the server is among them; then nothing listens at its address.
    """
    found: dict[Path, Server] = {}
    for file in _files(data):
        server = _read(file)
        if server is not None and _may_run(server.pid):
            found[file] = server
        else:
            with suppress(OSError):
                file.unlink()
    return found


def _files(data: Path) -> list[Path]:
    dated: list[tuple[float, Path]] = []
    for file in (data / _FOLDER).glob("*.json"):
        with suppress(OSError):
            dated.append((file.stat().st_mtime, file))
    return [file for _, file in sorted(dated, reverse=True)]


def _read(file: Path) -> Server | None:
    try:
        with file.open("rb") as opened:
            said = json.loads(opened.read(_MOST_BYTES))
        return Server(str(said["address"]), str(said["key"]), int(said["pid"]))
    except (OSError, ValueError, TypeError, KeyError):
        return None


def _may_run(pid: int) -> bool:
    """Return whether there is such a process, or whether that cannot be asked."""
    if os.name != "posix":
        return True  # there, signal 0 is Ctrl-C
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True

"""The running dashboards of the current user on this machine: addresses and start keys.

Layer 4. Each running server keeps one small file, readable only by its owner::

    servers/1a2b3c4d.json    {"address": "http://127.0.0.1:8080/", "key": "…", "pid": 4711}

Programs send the key with each request, as ``Authorization: Bearer …``.
"""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from urc.private_files import put_private

__all__ = ["RunningServer", "announced", "headers", "servers"]

_FOLDER = "servers"
_MOST_BYTES = 4096


class RunningServer(NamedTuple):
    """A dashboard that is running, or was running when the machine lost power."""

    address: str
    """Base address, such as ``http://127.0.0.1:8080/``."""
    key: str
    """Start key."""
    pid: int
    """Process id."""
    public: str = ""
    """Base address for other devices; "" if the server accepts clients on this machine only."""


def headers(server: RunningServer) -> dict[str, str]:
    """Return the HTTP headers of a program's requests to `server`."""
    return {"authorization": f"Bearer {server.key}"}


@contextmanager
def announced(data: Path, name: str, server: RunningServer) -> Iterator[None]:
    """Announce `server` to other programs of the user while the context is open.

    Args:
        data: URC's data folder.
        name: unique name of the server, used as file name.
        server: the server.

    Raises:
        OSError: the file cannot be written.
    """
    servers(data)  # also removes the files of killed servers
    file = data / _FOLDER / f"{name}.json"
    put_private(file, json.dumps(server._asdict()).encode())
    try:
        yield
    finally:
        with suppress(OSError):
            file.unlink()


def servers(data: Path) -> dict[Path, RunningServer]:
    """Return the servers announced in the data folder, the newest first.

    Files of killed servers are removed. If the system cannot tell whether a process runs, its
    server stays in the list, although the address may not respond.
    """
    found: dict[Path, RunningServer] = {}
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


def _read(file: Path) -> RunningServer | None:
    try:
        with file.open("rb") as opened:
            said = json.loads(opened.read(_MOST_BYTES))
        public = str(said.get("public", ""))
        return RunningServer(str(said["address"]), str(said["key"]), int(said["pid"]), public)
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None


def _may_run(pid: int) -> bool:
    """Return whether the process exists, or may exist."""
    if os.name != "posix":
        return True  # on Windows, signal 0 is Ctrl-C
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True

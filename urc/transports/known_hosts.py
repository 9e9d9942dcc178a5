"""Trusted SSH host keys, from URC's own file and from the transport options.

URC's file uses the format of OpenSSH's ``known_hosts``. Only `remember` adds keys to this file,
after a person has confirmed the key with ``urc trust``.
"""

from pathlib import Path
from typing import NamedTuple

import asyncssh

from urc._folders import data_folder
from urc.private_files import put_private
from urc.transports.base import TransportError

__all__ = ["DEFAULT_PORT", "HostKeys", "HostKeyStatus", "fingerprint", "own_file", "remember"]

DEFAULT_PORT = 22


class HostKeyStatus(NamedTuple):
    """The known host keys of one server."""

    trusted: tuple[asyncssh.SSHKey, ...] = ()
    authorities: tuple[asyncssh.SSHKey, ...] = ()
    """Certificate authority keys that sign host keys."""
    revoked: tuple[asyncssh.SSHKey, ...] = ()


def own_file() -> Path:
    """Return the path of the file in which URC stores confirmed host keys."""
    return data_folder() / "known_hosts"


def fingerprint(key: asyncssh.SSHKey) -> str:
    """Return the fingerprint ``SHA256:…`` of a key, as printed by ``ssh-keygen -l``."""
    return str(key.get_fingerprint("sha256"))


class HostKeys:
    """The trusted host keys of one transport."""

    def __init__(self, pinned: str = "", file: str = "") -> None:
        """Trust either a single fingerprint, or the keys in URC's own file and an additional file.

        Args:
            pinned: fingerprint ``SHA256:…``; "" to use the files.
            file: path of an additional ``known_hosts`` file; "" for none.
        """
        self._pinned = pinned.rstrip("=")
        self._file = file

    @property
    def is_pinned(self) -> bool:
        """Whether the document contains the trusted fingerprint."""
        return bool(self._pinned)

    def known(self, host: str, port: int) -> HostKeyStatus:
        """Return the trusted host keys, certificate authorities and revoked keys of a server.

        Raises:
            TransportError: a file cannot be read.
        """
        if self._pinned:
            return HostKeyStatus()
        found = _read(own_file(), host, port, is_asked_for=False)
        if self._file:
            other = _read(Path(self._file).expanduser(), host, port, is_asked_for=True)
            found = HostKeyStatus(
                *(mine + theirs for mine, theirs in zip(found, other, strict=True))
            )
        return found

    def judge(self, key: asyncssh.SSHKey, known: HostKeyStatus) -> str:
        """Return "" for a trusted `key`, else trusted fingerprints, ``revoked`` or ``unknown``."""
        if self._pinned:
            return "" if fingerprint(key) == self._pinned else self._pinned
        if key in known.revoked:
            return "revoked"
        if key in known.trusted:
            return ""
        return " or ".join(map(fingerprint, known.trusted)) or "unknown"


def remember(host: str, port: int, key: asyncssh.SSHKey) -> Path:
    """Store `key` in URC's own file as the only key of a server; return the file's path.

    Raises:
        TransportError: the file cannot be written.
    """
    file = own_file()
    name = _name(host, port)
    public = key.export_public_key("openssh").decode("ascii").split()
    try:
        lines = file.read_text("utf-8").splitlines() if file.exists() else []
        kept = [line for line in lines if line.split(" ", 1)[0] != name]
        _write(file, "\n".join([*kept, f"{name} {public[0]} {public[1]}"]) + "\n")
    except (OSError, UnicodeError) as fault:
        raise TransportError(f"cannot write {file} ({_why(fault)})") from fault
    return file


def _name(host: str, port: int) -> str:
    return host if port == DEFAULT_PORT else f"[{host}]:{port}"


def _read(file: Path, host: str, port: int, *, is_asked_for: bool) -> HostKeyStatus:
    try:
        text = file.read_text("utf-8")
    except FileNotFoundError as missing:
        if is_asked_for:
            raise TransportError(f"the known-hosts file {file} does not exist") from missing
        return HostKeyStatus()
    except (OSError, UnicodeError) as fault:
        raise TransportError(f"cannot read the known-hosts file {file} ({_why(fault)})") from fault
    try:
        # Given a port, asyncssh would accept the key for port 22 on any other port.
        found = asyncssh.match_known_hosts(
            asyncssh.import_known_hosts(text), _name(host, port), "", None
        )
    except ValueError as fault:
        raise TransportError(f"{file} is not a known-hosts file ({fault})") from fault
    trusted, authorities, revoked = (tuple(keys) for keys in found[:3])
    return HostKeyStatus(trusted, authorities, revoked)


def _write(file: Path, text: str) -> None:
    """Replace the whole file with a file that only its owner can read."""
    put_private(file, text.encode())


def _why(fault: Exception) -> str:
    return str(getattr(fault, "strerror", None) or fault).lower()

"""Audit entries for commands run on this machine, written to the data folder's audit log.

A running server may write to the same file. Both processes extend the same hash chain.
"""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from urc.cli.output import complain

if TYPE_CHECKING:
    from urc.runtime.server_recorder import Actor, ServerRecorder

__all__ = ["audit_access", "audit_packages"]

_WAIT_S = 2.0
"""Maximum time for writing an entry, in seconds."""


def audit_access(data: Path, command: str, **about: object) -> None:
    """Write an audit entry for a command that has changed people, devices, programs or roles.

    Args:
        data: the data folder.
        command: the change, such as ``people grant``.
        about: details such as names, roles and times, without secrets.
    """
    _write(data, lambda recorder, user: recorder.access_changed(user, command, **about))


def audit_packages(command: str, packages: Iterable[object]) -> None:
    """Write an audit entry for a command that has changed packages or repositories.

    Args:
        command: the change, such as ``install``.
        packages: packages with their versions, or repository addresses.
    """
    from urc._folders import data_folder

    names = [str(one) for one in packages]
    _write(data_folder(), lambda recorder, user: recorder.package_changed(user, command, names))


def _write(data: Path, event: "Callable[[ServerRecorder, Actor], None]") -> None:
    """Write one entry and wait until it is written; print a message on failure."""
    from urc.runtime.audit import FILE, AuditLog
    from urc.runtime.server_recorder import ServerRecorder, terminal_actor

    with AuditLog(data / FILE) as log:
        event(ServerRecorder(log.add), terminal_actor())
        is_written = log.settle(_WAIT_S)
        fault = log.fault
    if fault or not is_written:
        complain(f"urc: this action is missing from the audit log: {fault or 'the file is busy'}")

"""Tokens of programs, and links of guests: each secret is shown once, and ends by itself.

Layer 4. The functions block for some milliseconds.
"""

from collections.abc import Iterable

from urc.access.directory import Principal
from urc.access.grants import AccessError, Grant
from urc.access.lifetimes import LONGEST_GUEST_S
from urc.access.store import AccessStore

__all__ = ["add_guest", "add_token"]


def add_token(
    store: AccessStore,
    name: str,
    grants: Iterable[Grant],
    *,
    now: float,
    ends_at: float | None,
    commands: Iterable[str] = (),
) -> tuple[Principal, str]:
    """Add a program, and return it with its token.

    Args:
        store: the store.
        name: name of the program.
        grants: rights of the token.
        now: UTC time in seconds since 1970.
        ends_at: UTC time of the end; None: never.
        commands: commands that the program may give; none: all of its role.

    Raises:
        AccessError: the name is invalid or in use, or the token has no right or no future.
    """
    grants = tuple(grants)
    if not grants:
        raise AccessError("a token needs a role")
    if ends_at is not None and ends_at <= now:
        raise AccessError("the end of the token is past")
    with store.transaction():
        program = store.add("program", name, grants, now=now, commands=commands, ends_at=ends_at)
        _, token = store.open_sign_in(program.id, "token", now=now, ends_at=ends_at)
    return program, token


def add_guest(
    store: AccessStore, name: str, robot: str, *, now: float, ends_at: float
) -> tuple[Principal, str]:
    """Add a guest who may watch one robot, and return the guest with the secret of the link.

    Several browsers may use the link.

    Args:
        store: the store.
        name: name of the guest.
        robot: name of the robot in URLs.
        now: UTC time in seconds since 1970.
        ends_at: UTC time of the end.

    Raises:
        AccessError: the name is invalid or in use, or the end is past or too late.
    """
    if not now < ends_at <= now + LONGEST_GUEST_S:
        days = LONGEST_GUEST_S / 86400
        raise AccessError(f"a guest link lasts at most {days:.0f} days")
    with store.transaction():
        guest = store.add("guest", name, [Grant("watch", robot)], now=now, ends_at=ends_at)
        _, secret = store.open_sign_in(guest.id, "link", now=now, ends_at=ends_at)
    return guest, secret

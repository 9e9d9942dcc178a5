"""Roles of people, devices and programs: their rights at a robot. Each contains those before it.

Layer 2.
"""

from typing import Final, Literal

__all__ = ["ROLES", "Role", "includes"]

Role = Literal["watch", "drive", "maintain", "administer"]
"""``watch`` reads and may press STOP. ``drive`` gives commands, drives and resets STOP.
``maintain`` changes settings and packages, and takes the controls by force. ``administer`` manages
people, devices and tokens."""
ROLES: Final[tuple[Role, ...]] = ("watch", "drive", "maintain", "administer")
"""All roles, by increasing rights."""
_RANK: Final = {role: rank for rank, role in enumerate(ROLES)}


def includes(role: Role | None, needed: Role) -> bool:
    """Return whether `role` contains the rights of `needed`; None is no role at all."""
    return role is not None and _RANK[role] >= _RANK[needed]

"""Roles of people, devices and programs, which define their rights for a robot.

Layer 2. Each role includes the rights of the previous roles.
"""

from typing import Final, Literal

__all__ = ["ROLES", "Role", "includes"]

Role = Literal["watch", "drive", "maintain", "administer"]
"""The role ``watch`` may read all values and press STOP. The role ``drive`` may also send commands,
drive and reset STOP. The role ``maintain`` may also change settings and packages, and take control
by force. The role ``administer`` may also manage people, devices and tokens."""
ROLES: Final[tuple[Role, ...]] = ("watch", "drive", "maintain", "administer")
"""All roles, in order of increasing rights."""
_RANK: Final = {role: rank for rank, role in enumerate(ROLES)}


def includes(role: Role | None, needed: Role) -> bool:
    """Return whether `role` includes the rights of `needed`; None means no role."""
    return role is not None and _RANK[role] >= _RANK[needed]

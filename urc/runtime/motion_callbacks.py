"""The callbacks of a motion controller, and their defaults, which ignore each event."""

from collections.abc import Callable, Mapping

from urc.model.payload import Payload
from urc.model.values import Reading
from urc.motion.lease import LeaseState, Operator

__all__ = ["Moved", "unchanged", "unrefused", "unseen"]

Moved = Callable[[Operator, int, str, Mapping[str, Reading], Payload, float], None]
"""Arguments of the callback: operator, lease epoch, command, arguments, frame, time."""


def unchanged(state: LeaseState) -> None:
    """Ignore a change of the lease."""


def unrefused(command: str, why: str) -> None:
    """Ignore a refusal by the robot."""


def unseen(
    client: Operator,
    epoch: int,
    command: str,
    arguments: Mapping[str, Reading],
    data: Payload,
    now: float,
) -> None:
    """Ignore a tick."""

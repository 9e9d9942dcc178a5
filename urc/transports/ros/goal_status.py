"""The states of an action's goals, which the action's server publishes on a hidden topic. Pure.

The newest message is latched, so a new subscriber receives it soon. It lists the goals of all
programs. A server publishes nothing before its first goal.

Sources: action_msgs/msg/GoalStatusArray; ROS 2 design, Actions.
"""

import json
from collections.abc import Mapping
from typing import Any, Final

__all__ = ["SILENT_S", "STATUS", "STATUS_TYPE", "bytes_show_active", "shows_active"]

STATUS: Final = "/_action/status"
"""End of the name of the topic with the states of an action's goals; the newest message is latched.
"""
STATUS_TYPE: Final = "action_msgs/msg/GoalStatusArray"
SILENT_S: Final = 1.0
"""Time within which the latched status arrives if there is one, in seconds."""
_ACTIVE: Final = (1, 2, 3)
"""States of accepted, executing and canceling goals (action_msgs/msg/GoalStatus)."""
_LAST: Final = 6
"""The largest state: aborted."""
_HEAD, _COUNT, _UUID, _STAMP = 4, 4, 16, 8
"""Sizes in CDR, in bytes: header, number of goals, id, and time stamp."""


def shows_active(status: Any) -> bool:
    """Return whether a status shows an active goal; an invalid status does not show the end."""
    listed = status.get("status_list") if isinstance(status, Mapping) else None
    if not isinstance(listed, list):
        return True
    states = [one.get("status") if isinstance(one, Mapping) else None for one in listed]
    return any(not isinstance(one, int) or one in _ACTIVE for one in states)


def bytes_show_active(data: bytes, encoding: str) -> bool:
    """Return whether a status in JSON or CDR shows an active goal, as `shows_active` does."""
    if encoding == "json":
        try:
            return shows_active(json.loads(data))
        except (ValueError, RecursionError):
            return True
    if len(data) < _HEAD + _COUNT:
        return True
    order = "little" if data[1] & 1 else "big"
    count = int.from_bytes(data[_HEAD : _HEAD + _COUNT], order)  # type: ignore[arg-type] # a literal
    at = _HEAD + _COUNT
    for _ in range(count):
        at += _UUID
        at += -at % 4 + _STAMP
        if at >= len(data) or data[at] in _ACTIVE or data[at] > _LAST:
            return True
        at += 1
    return False

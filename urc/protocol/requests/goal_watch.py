"""Reports about a goal of a ROS action: when it is sent, and when its end is known. Pure.

A command or sequence can end while the robot still follows a goal: at a time limit, or when the
connection is lost.
"""

from collections.abc import Callable
from typing import Final

from urc.model.payload import Envelope, Payload

__all__ = ["GoalWatch", "OnGoal"]

OnGoal = Callable[[str, bool], None]
"""Callback that receives a ROS action, and whether the end of its goal is known."""
_UNKNOWN: Final = ("disconnected", "timed-out", "stopped")
"""Codes of failures after which a robot may still be on its way to a goal."""


class GoalWatch:
    """The reports about the goal of one request."""

    def __init__(self, on_goal: OnGoal) -> None:
        """Prepare; `on_goal` receives the reports."""
        self._on_goal = on_goal
        self._action = ""

    def sent(self, payload: Payload) -> None:
        """Report a goal that is being sent."""
        if isinstance(payload, Envelope):
            self._action = str(payload.attributes.get("action") or "")
            self._on_goal(self._action, False)

    def ended(self, code: str = "") -> None:
        """Report the end of a goal that was sent, once, unless its reply is lost.

        Args:
            code: code of the failure; "" for a reply.
        """
        if self._action and code not in _UNKNOWN:
            action, self._action = self._action, ""
            self._on_goal(action, True)

"""The unfinished goals of one ROS bridge transport, kept across its connections.

A bridge does not cancel a goal when the client's connection is lost, so the robot drives on. A goal
can be cancelled by its id from any connection. The transport therefore keeps the ids: STOP
must also cancel a goal that was sent before a loss.
"""

from typing import Final

__all__ = ["MAX_GOALS", "UnfinishedGoals"]

MAX_GOALS: Final = 64
"""Maximum number of kept goals; above the limit, the oldest goal is dropped."""


class UnfinishedGoals:
    """Sent goals whose results have not arrived.

    The result of a goal that outlives its connection never arrives. Such a goal is kept until newer
    goals displace it; the server ignores the cancellation of a goal that has ended.
    """

    def __init__(self) -> None:
        self._actions: dict[str, str] = {}
        """Action of each goal, keyed by goal id, oldest first."""
        self._cancelled: set[str] = set()
        """Ids of the goals for which a cancellation was sent."""

    def add(self, goal: str, action: str) -> None:
        """Keep the goal with the id `goal`."""
        while len(self._actions) >= MAX_GOALS:
            self.finish(next(iter(self._actions)))
        self._actions[goal] = action

    def finish(self, goal: str) -> None:
        """Forget a goal whose result has arrived; ignore unknown ids."""
        self._actions.pop(goal, None)
        self._cancelled.discard(goal)

    def cancel(self, action: str) -> list[str]:
        """Return the ids of an action's goals, oldest first, and mark these goals as cancelled."""
        goals = [goal for goal, name in self._actions.items() if name == action]
        self._cancelled.update(goals)
        return goals

    def cancelled(self) -> list[tuple[str, str]]:
        """Return the id and action of each goal with a cancellation but without a result."""
        return [one for one in self._actions.items() if one[0] in self._cancelled]

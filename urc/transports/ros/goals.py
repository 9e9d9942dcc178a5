"""The unfinished goals of one ROS transport, kept across its connections and kinds of bridges.

A bridge does not cancel a goal when the client's connection is lost, so the robot drives on. A goal
can be cancelled by its id from any connection. The transport therefore keeps the ids: STOP
must also cancel a goal that was sent before a loss.

The record also keeps the actions of which all goals are to be cancelled. The robot *owes* an answer
to this cancellation. The cancellation is repeated, on later connections too, until the answer
arrives or a new goal of the action is sent.

With ``via: auto``, goals of both kinds of bridges are in one record. A bridge can only cancel goals
that were sent through its own kind of bridge by their ids.
"""

import re
from collections.abc import Callable
from typing import Final

from urc.transports.base import GoalRecord

__all__ = ["FIRST_S", "MAX_GOALS", "UnfinishedGoals", "is_ros_id", "longer"]

MAX_GOALS: Final = 64
"""Maximum number of kept goals, and of actions; above the limit, the oldest one is dropped."""
FIRST_S: Final = 1.0
"""Time after which an unanswered cancellation is first repeated, in seconds."""
_LONGEST_S: Final = 10.0
_ROS_ID: Final = re.compile("[0-9a-f]{32}")


def longer(wait_s: float) -> float:
    """Return the wait before the repetition after next, in seconds: twice as long, at most 10 s."""
    return min(2 * wait_s, _LONGEST_S)


def is_ros_id(goal: str) -> bool:
    """Return whether a goal's id is an id of ROS 2, in hex; the ids of rosbridge are names."""
    return _ROS_ID.fullmatch(goal) is not None


class UnfinishedGoals:
    """Sent goals whose results have not arrived, and actions that owe a cancellation.

    The result of a goal that outlives its connection never arrives. Such a goal is kept until newer
    goals displace it; the server ignores the cancellation of a goal that has ended.
    """

    def __init__(self) -> None:
        self._actions: dict[str, str] = {}
        """Action of each goal, keyed by goal id, oldest first."""
        self._cancelled: set[str] = set()
        """Ids of the goals for which a cancellation was sent."""
        self._owed: dict[str, None] = {}
        """Actions whose cancellation of all goals has not been answered, oldest first."""
        self._changed: Callable[[GoalRecord], None] | None = None

    @property
    def record(self) -> GoalRecord:
        """The whole record."""
        goals = tuple((one, name, one in self._cancelled) for one, name in self._actions.items())
        return GoalRecord(goals, tuple(self._owed))

    def keep(self, record: GoalRecord, changed: Callable[[GoalRecord], None]) -> None:
        """Add the goals of an earlier process, and call `changed` after each later change."""
        for goal, action, is_cancelled in record.goals:
            self.add(goal, action)
            if is_cancelled:
                self._cancelled.add(goal)
        self._owed.update(dict.fromkeys(record.owed[:MAX_GOALS]))
        self._changed = changed

    def _report(self) -> None:
        if self._changed is not None:
            self._changed(self.record)

    def add(self, goal: str, action: str) -> None:
        """Keep the goal with the id `goal`."""
        while len(self._actions) >= MAX_GOALS:
            self._forget(next(iter(self._actions)))
        self._actions[goal] = action
        self._report()

    def finish(self, goal: str) -> None:
        """Forget a goal whose result has arrived; ignore unknown ids."""
        if goal in self._actions:
            self._forget(goal)
            self._report()

    def _forget(self, goal: str) -> None:
        self._actions.pop(goal, None)
        self._cancelled.discard(goal)

    def cancel(self, action: str) -> list[str]:
        """Mark an action's goals as cancelled, and the action as owing the cancellation of all.

        Returns:
            The ids of the action's known goals, oldest first.
        """
        goals = [goal for goal, name in self._actions.items() if name == action]
        self._cancelled.update(goals)
        self._owed.pop(action, None)
        while len(self._owed) >= MAX_GOALS:
            del self._owed[next(iter(self._owed))]
        self._owed[action] = None
        self._report()
        return goals

    def cancel_late(self, goal: str, action: str) -> None:
        """Keep a goal that the robot has accepted after its cancellation, and mark it again."""
        if goal not in self._actions:
            self.add(goal, action)
        self._cancelled.add(goal)
        self._report()

    def cancelled(self) -> list[tuple[str, str]]:
        """Return the id and action of each goal with a cancellation but without a result."""
        return [one for one in self._actions.items() if one[0] in self._cancelled]

    def action(self, goal: str) -> str:
        """Return the action of a kept goal; "" for an unknown id."""
        return self._actions.get(goal, "")

    def is_cancelled(self, goal: str) -> bool:
        """Return whether a goal has a cancellation but no result."""
        return goal in self._cancelled

    # -- the cancellation of all goals of an action

    def owes(self, action: str) -> bool:
        """Return whether the robot owes an answer to the cancellation of all goals."""
        return action in self._owed

    def owed(self) -> list[str]:
        """Return the actions that owe the cancellation of all goals, oldest first."""
        return list(self._owed)

    def settle(self, action: str) -> None:
        """Forget the cancellation of all goals: it was answered, or a new goal is being sent."""
        if action in self._owed:
            del self._owed[action]
            self._report()

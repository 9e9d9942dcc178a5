"""The unfinished goals of one ROS transport, kept across its connections and kinds of bridges.

A bridge does not cancel a goal when the client's connection is lost, so the robot drives on. A goal
can be cancelled by its id from any connection. The transport therefore keeps the ids: STOP
must also cancel a goal that was sent before a loss.

The record also keeps the actions of which all goals are to be cancelled. The robot *owes* an answer
to this cancellation. The cancellation is repeated, on later connections too, until the answer
arrives. It is *dropped* without an answer when a new goal of the action is sent. A reset of STOP
drops those that STOP has sent.

The robot can receive a cancellation of all goals late, and then it also ends newer goals. The
record therefore keeps the actions with a call that was not answered, and explains such an end.

With ``via: auto``, goals of both kinds of bridges are in one record. A bridge can only cancel goals
that were sent through its own kind of bridge by their ids.
"""

import re
from collections.abc import Callable, Collection
from typing import Final

from urc.transports.base import GoalRecord

__all__ = ["FIRST_S", "LATE", "MAX_GOALS", "UnfinishedGoals", "is_ros_id", "longer"]

MAX_GOALS: Final = 64
"""Maximum number of kept goals, and of actions; above the limit, the oldest one is dropped."""
FIRST_S: Final = 1.0
"""Time after which an unanswered cancellation is first repeated, in seconds."""
LATE: Final = (
    "the action was cancelled: the robot may have received an earlier cancellation of all goals,"
    " such as that of STOP, late"
)
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
        self._dropped: dict[str, None] = {}
        """Actions whose cancellation of all goals has ended without an answer, oldest first."""
        self._called: dict[str, None] = {}
        """Actions with an unanswered call that cancels all goals, oldest first."""
        self._doubted: set[str] = set()
        """Goals that were sent after such a call of their action."""
        self._changed: Callable[[GoalRecord], None] | None = None

    @property
    def record(self) -> GoalRecord:
        """The whole record."""
        goals = tuple((one, name, one in self._cancelled) for one, name in self._actions.items())
        return GoalRecord(goals, tuple(self._owed), tuple(self._dropped))

    def keep(self, record: GoalRecord, changed: Callable[[GoalRecord], None]) -> None:
        """Add the goals of an earlier process, and call `changed` after each later change."""
        for goal, action, is_cancelled in record.goals:
            self.add(goal, action)
            if is_cancelled:
                self._cancelled.add(goal)
        self._owed.update(dict.fromkeys(record.owed[:MAX_GOALS]))
        self._dropped.update(dict.fromkeys(record.dropped[:MAX_GOALS]))
        self._changed = changed

    def _report(self) -> None:
        if self._changed is not None:
            self._changed(self.record)

    def add(self, goal: str, action: str) -> None:
        """Keep the goal with the id `goal`."""
        while len(self._actions) >= MAX_GOALS:
            self._forget(next(iter(self._actions)))
        self._actions[goal] = action
        if action in self._called:
            self._doubted.add(goal)
        self._report()

    def finish(self, goal: str) -> None:
        """Forget a goal whose result has arrived; ignore unknown ids."""
        if goal in self._actions:
            self._forget(goal)
            self._report()

    def _forget(self, goal: str) -> None:
        self._actions.pop(goal, None)
        self._cancelled.discard(goal)
        self._doubted.discard(goal)

    def cancel(self, action: str) -> list[str]:
        """Mark an action's goals as cancelled, and the action as owing the cancellation of all.

        Returns:
            The ids of the action's known goals, oldest first.
        """
        goals = [goal for goal, name in self._actions.items() if name == action]
        self._cancelled.update(goals)
        _append(self._owed, action)
        self._dropped.pop(action, None)
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

    def owed(self, actions: Collection[str] | None = None) -> list[str]:
        """Return the actions that owe the cancellation of all goals, oldest first.

        Args:
            actions: the actions to look at; None for all.
        """
        return [one for one in self._owed if actions is None or one in actions]

    def settle(self, action: str) -> None:
        """Forget the cancellation of all goals, because it was answered."""
        if action in self._owed:
            del self._owed[action]
            self._report()

    def drop(self, action: str) -> None:
        """End the cancellation of all goals without an answer: a new goal is permitted."""
        if action in self._owed:
            del self._owed[action]
            _append(self._dropped, action)
            self._report()

    def called(self, action: str) -> None:
        """Note that a cancellation of all goals is being sent, which the robot may handle late."""
        _append(self._called, action)

    def replied(self, action: str) -> None:
        """Note that the robot has handled the cancellation of all goals."""
        self._called.pop(action, None)

    def why_cancelled(self, goal: str) -> str:
        """Return why a goal may have ended as cancelled; "" if nothing is known."""
        if goal not in self._doubted or goal in self._cancelled:
            return ""
        return LATE


def _append(found: dict[str, None], action: str) -> None:
    """Add an action as the newest; above the limit, drop the oldest."""
    found.pop(action, None)
    while len(found) >= MAX_GOALS:
        del found[next(iter(found))]
    found[action] = None

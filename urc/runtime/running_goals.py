"""The autonomous motion of a robot: who has started it, when, and where it leads.

Layer 4. Every page shows these goals, also a page that was opened later. A goal runs until the
reply to its command. The reply to a ROS goal is lost with its connection, but the robot may go on.
Such a goal is *lost*. It is kept until STOP or a cancellation has ended it, or until a person
dismisses it. A newer goal does not end it, because not every robot ends a goal for the next one.

A sequence may send several goals. It is lost with those whose end is not known.

The goals outlive the robot's sessions. After a restart of the server, no goal is known.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

from urc.model.payload import Envelope, Payload
from urc.model.values import NOTHING, Reading

__all__ = ["MAX_GOALS", "RunningGoal", "RunningGoals", "action_of", "places_of"]

MAX_GOALS: Final = 16
"""Maximum number of goals of one robot; above it, the oldest is dropped, and
lost ones first."""
MAX_NUMBERS: Final = 1200
"""Maximum number of numbers in the arguments of a goal; longer arguments are left out."""


class RunningGoal(NamedTuple):
    """One command with autonomous motion that has not ended."""

    number: int
    """Number of the goal, unique in its session."""
    command: str
    places: Mapping[str, Reading] = NOTHING
    """Arguments with numbers, such as the waypoints of a route, keyed by argument."""
    by: str = ""
    """Name of the operator who has started it."""
    page: str = ""
    """Identifier of the operator's page."""
    since_s: float = 0.0
    """Start, in seconds on the session's clock."""
    actions: tuple[str, ...] = ()
    """ROS actions of the goals that the command has sent and whose end is not known."""
    is_lost: bool = False
    """Whether the reply can't arrive any more, although the robot may go on."""
    title: str = ""
    """Title of the command; "" without one."""


class RunningGoals:
    """The goals of one robot, oldest first."""

    def __init__(self) -> None:
        self._goals: dict[int, RunningGoal] = {}
        self._count = 0

    def __iter__(self) -> Iterator[RunningGoal]:
        return iter(tuple(self._goals.values()))

    def begin(self, goal: RunningGoal) -> int:
        """Add a goal and return its number."""
        while len(self._goals) >= MAX_GOALS:
            lost = (number for number, one in self._goals.items() if one.is_lost)
            del self._goals[next(lost, next(iter(self._goals)))]
        self._count += 1
        self._goals[self._count] = goal._replace(number=self._count)
        return self._count

    def sent(self, number: int, action: str) -> None:
        """Note the ROS action to which a goal was sent; ignore "" and unknown numbers."""
        goal = self._goals.get(number)
        if goal is not None and action and action not in goal.actions:
            self._goals[number] = goal._replace(actions=(*goal.actions, action))

    def over(self, number: int, action: str) -> None:
        """Note that a goal of an action has ended, even if its command has ended before."""
        goal = self._goals.get(number)
        if goal is not None:
            self._without(goal, action)

    def end(self, number: int, *, is_lost: bool = False) -> None:
        """End a goal; keep the goal of a ROS action whose reply is lost."""
        goal = self._goals.get(number)
        if goal is not None and is_lost and goal.actions:
            self._goals[number] = goal._replace(is_lost=True)
        else:
            self._goals.pop(number, None)

    def settle(self, action: str | None = None) -> bool:
        """Drop the lost goals of an action, or of all actions; return whether there were any."""
        found = [one for one in self if one.is_lost and (action is None or action in one.actions)]
        for goal in found:
            if action is None:
                del self._goals[goal.number]
            else:
                self._without(goal, action)
        return bool(found)

    def dismiss(self, number: int) -> bool:
        """Drop a lost goal that a person knows to have ended; return whether it was lost."""
        goal = self._goals.get(number)
        if goal is None or not goal.is_lost:
            return False
        del self._goals[number]
        return True

    @property
    def is_awaited(self) -> bool:
        """Whether the reply of a goal can still arrive."""
        return any(not one.is_lost for one in self)

    def _without(self, goal: RunningGoal, action: str) -> None:
        """Remove an action from a goal, and a lost goal after its last action."""
        actions = tuple(one for one in goal.actions if one != action)
        self._goals[goal.number] = goal._replace(actions=actions)
        if goal.is_lost and not actions:
            del self._goals[goal.number]


def action_of(payload: Payload | None, verb: str) -> str:
    """Return the ROS action of a sent goal or cancellation; "" for any other payload."""
    if not isinstance(payload, Envelope) or payload.verb != verb:
        return ""
    return str(payload.attributes.get("action") or "")


def places_of(arguments: Mapping[str, object]) -> Mapping[str, Reading]:
    """Return the arguments that are numbers or lists of numbers; NOTHING if there are too many.

    Texts are left out, because every page gets the result, and a text may be private.
    """
    found: dict[str, Reading] = {}
    count = 0
    for name, value in arguments.items():
        numbers = value if isinstance(value, (list, tuple)) else (value,)
        count += len(numbers)
        if count > MAX_NUMBERS:
            return NOTHING
        if all(map(_is_number, numbers)):
            found[name] = tuple(value) if isinstance(value, (list, tuple)) else value  # type: ignore[assignment] # numbers
    return found


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)

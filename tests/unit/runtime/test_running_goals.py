"""Goals that every page shows: their end, their loss, and what is told of them."""

from urc.model.payload import Envelope
from urc.runtime.running_goals import (
    MAX_GOALS,
    MAX_NUMBERS,
    RunningGoal,
    RunningGoals,
    action_of,
    places_of,
)

GOTO = RunningGoal(0, "goto")


def commands(goals: RunningGoals) -> list[tuple[str, bool]]:
    return [(one.command, one.is_lost) for one in goals]


def test_a_goal_lasts_until_its_reply() -> None:
    goals = RunningGoals()
    number = goals.begin(GOTO)
    assert [one.number for one in goals] == [number]
    goals.end(number)
    goals.end(number)
    assert commands(goals) == []


def test_a_ros_goal_whose_reply_is_lost_stays_until_a_cancellation_of_its_action() -> None:
    """The robot may go on. A command that was never sent, or that is no goal, has ended."""
    goals = RunningGoals()
    sent, unsent = goals.begin(GOTO), goals.begin(RunningGoal(0, "fold"))
    goals.sent(sent, "/navigate_to_pose")
    for number in (sent, unsent):
        goals.end(number, is_lost=True)
    assert commands(goals) == [("goto", True)]
    assert not goals.settle("/follow_waypoints")
    assert goals.settle("/navigate_to_pose")
    assert commands(goals) == []


def test_stop_ends_all_lost_goals_but_no_goal_that_has_a_reply_to_come() -> None:
    goals = RunningGoals()
    lost, running = goals.begin(GOTO), goals.begin(RunningGoal(0, "follow"))
    goals.sent(lost, "/navigate_to_pose")
    goals.end(lost, is_lost=True)
    assert goals.settle()
    assert [one.number for one in goals] == [running]


def test_a_newer_goal_of_the_action_replaces_a_lost_one_once_it_is_sent() -> None:
    goals = RunningGoals()
    lost = goals.begin(GOTO)
    goals.sent(lost, "/navigate_to_pose")
    goals.end(lost, is_lost=True)
    newer = goals.begin(GOTO)
    assert [one.number for one in goals] == [lost, newer], "it may be refused"
    goals.sent(newer, "/navigate_to_pose")
    assert [one.number for one in goals] == [newer]


def test_goals_are_bounded_and_the_newest_stay() -> None:
    goals = RunningGoals()
    numbers = [goals.begin(GOTO) for _ in range(MAX_GOALS + 5)]
    assert [one.number for one in goals] == numbers[5:]


def test_only_numbers_are_told() -> None:
    """A text may be a name or a password; every page gets the arguments."""
    given = {"xs": [1, 2.5], "y": 3, "word": "secret", "is": True, "mixed": [1, "a"], "z": 1e999}
    assert places_of(given) == {"xs": (1, 2.5), "y": 3}


def test_too_many_numbers_are_not_told() -> None:
    assert places_of({"xs": [0.0] * MAX_NUMBERS}) == {"xs": (0.0,) * MAX_NUMBERS}
    assert places_of({"xs": [0.0] * MAX_NUMBERS, "y": 1}) == {}


def test_the_action_of_a_sent_goal() -> None:
    goal = Envelope("goal", {"action": "/dock"}, {})
    assert action_of(goal, "goal") == "/dock"
    for payload in (None, b"M 1", goal._replace(verb="cancel"), Envelope("goal", {})):
        assert action_of(payload, "goal") == ""

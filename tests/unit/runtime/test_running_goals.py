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


def test_a_newer_goal_of_the_action_does_not_hide_a_lost_one() -> None:
    """Not every robot ends a goal for the next one, and the robot may refuse the newer goal."""
    goals = RunningGoals()
    lost = goals.begin(GOTO)
    goals.sent(lost, "/navigate_to_pose")
    newer = goals.begin(GOTO)
    goals.end(lost, is_lost=True)
    goals.sent(newer, "/navigate_to_pose")
    assert [one.number for one in goals] == [lost, newer], "oldest first"
    goals.end(newer)
    assert [one.number for one in goals] == [lost]


def test_a_person_dismisses_a_lost_goal_but_no_goal_that_has_a_reply_to_come() -> None:
    goals = RunningGoals()
    lost, running = goals.begin(GOTO), goals.begin(GOTO)
    goals.sent(lost, "/navigate_to_pose")
    goals.end(lost, is_lost=True)
    assert goals.is_awaited
    assert [goals.dismiss(one) for one in (running, lost, lost, 99)] == [False, True, False, False]
    assert [one.number for one in goals] == [running]
    goals.end(running)
    assert not goals.is_awaited


def test_a_sequence_is_lost_with_the_goals_whose_end_is_not_known() -> None:
    goals = RunningGoals()
    tour, over = goals.begin(RunningGoal(0, "tour")), goals.begin(RunningGoal(0, "over"))
    for action in ("/undock", "/navigate_to_pose", "/dock"):
        goals.sent(tour, action)
    goals.over(tour, "/undock")
    goals.sent(over, "/undock")
    goals.over(over, "/undock")
    for number in (tour, over):
        goals.end(number, is_lost=True)
    assert [one.actions for one in goals] == [("/navigate_to_pose", "/dock")]
    assert goals.settle("/dock")
    goals.over(tour, "/navigate_to_pose")
    assert commands(goals) == [], "a late reply ends it, too"


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

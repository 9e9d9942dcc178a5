"""Goals over the Foxglove protocol after a STOP, and the times in them."""

import struct

import pytest

from tests.unit.transports.foxglove_bridge import ALL, CANCEL, DOCK, TEXTS, YES, Bridge, code
from urc.guard.goal_reports import GoalReports
from urc.transports.base import GoalRecord, SupportsGoals, TransportSetup
from urc.transports.ros.choice import from_setup
from urc.transports.ros.goals import LATE, UnfinishedGoals


@pytest.mark.parametrize("is_answered", [False, True])
def test_a_goal_that_a_late_cancellation_may_have_ended_says_so(is_answered: bool) -> None:
    bridge = Bridge().offer()
    bridge.session.perform(CANCEL)
    ((_, cancel),) = bridge.cancelled()
    if is_answered:
        bridge.reply(cancel, code(2))
    call, _ = bridge.start()
    bridge.reply(call, YES)
    bridge.encode()
    ((_, result, _),) = bridge.sent()
    bridge.reply(result, b"\0\1\0\0" + struct.pack("<b3xf", 5, 0))
    (told,) = bridge.told()
    response = bridge.codec.received(told).envelope
    assert response is not None
    assert response.attributes["status"] == 5
    expected = "the action was cancelled" if is_answered else LATE
    assert response.attributes["reason"] == expected


def test_a_reset_ends_the_cancellation_of_all_goals_but_not_that_of_known_goals() -> None:
    goals = UnfinishedGoals()
    bridge = Bridge(goals).offer()
    call, goal = bridge.start()
    bridge.reply(call, YES)
    bridge.session.perform(CANCEL)
    assert {one for one, _ in bridge.cancelled()} == {ALL, goal}
    bridge.session.drop_cancellation("/dock")
    bridge.advance(60)
    assert {one for one, _ in bridge.cancelled()} == {goal}
    assert goals.record.dropped == ("/dock",)


def test_a_goal_carries_the_robots_time_in_place_of_now(monkeypatch: pytest.MonkeyPatch) -> None:
    """The engine encodes goals, and the transport knows the time: it writes it into the bytes."""
    text = "unique_identifier_msgs/UUID goal_id\nbuiltin_interfaces/Time[] times"
    monkeypatch.setitem(TEXTS, "send_goal", (text, "bool accepted"))
    bridge = Bridge().offer()
    robot_s = 4_000
    bridge.session.arrived(struct.pack("<BQ", 2, robot_s * 10**9))
    bridge.session.perform(DOCK._replace(body={"times": ["now", {"sec": 5, "nanosec": 6}, "now"]}))
    bridge.encode()
    ((_, _, data),) = bridge.sent()
    count, first, _, second, third, last, _ = struct.unpack("<IIIIIII", data[20:])
    assert (count, second, third) == (3, 5, 6)
    assert first == last
    assert robot_s <= first <= robot_s + 60


@pytest.mark.parametrize("via", ["foxglove", "rosbridge", "auto"])
def test_a_reset_names_the_actions_whose_cancellations_end(via: str) -> None:
    """The goals of /dock were cancelled by a command, and those of /follow by STOP."""
    transport = from_setup(TransportSetup("ros", {"via": via, "host": "127.0.0.1"}))
    assert isinstance(transport, SupportsGoals)
    reports: list[GoalRecord] = []
    transport.keep_goals(GoalRecord(owed=("/dock", "/follow")), reports.append)
    transport.end_cancellations(["/follow", "/never"])
    assert reports == [GoalRecord(owed=("/dock",), dropped=("/follow",))]


def test_reports_take_only_the_named_cancellations_as_dropped() -> None:
    reports = GoalReports(("a", "b", "c"))
    reports.changed("a", GoalRecord(owed=("/dock", "/follow"), dropped=("/old",)))
    reports.changed("b", GoalRecord(owed=("/dock",)))
    since = 0
    assert reports.end(["/follow"]) == ["a"]
    assert reports.answer("a", "/follow", since) == "dropped"
    assert [reports.answer(line, "/dock", since) for line in "ab"] == ["owed", "owed"]
    assert reports.end(["/dock"]) == ["a", "b"]
    assert reports.end(["/dock", "/follow"]) == []

"""Goals by the hidden services of actions: what is sent, and what STOP ends in each state."""

import struct

import numpy as np
import pytest

from tests.e2e.transports.peers.foxglove_action import STORE
from tests.unit.transports.foxglove_bridge import (
    ALL,
    CANCEL,
    DOCK,
    NO,
    TEXTS,
    YES,
    Bridge,
    answer,
    code,
)
from urc.model.driver import STOPPED
from urc.model.payload import UNKNOWN_END, Envelope
from urc.transports.base import NOTICE
from urc.transports.ros.foxglove_actions import HIDDEN
from urc.transports.ros.goals import MAX_GOALS, UnfinishedGoals


def test_a_cancellation_has_the_bytes_of_its_type() -> None:
    bridge = Bridge().offer()
    _, goal = bridge.start()
    bridge.session.perform(CANCEL)
    stamp = STORE.types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    every, one = bridge.sent()
    for (_, _, data), wanted in ((every, ALL), (one, goal)):
        uuid = np.frombuffer(bytes.fromhex(wanted), dtype=np.uint8)
        number = STORE.types["unique_identifier_msgs/msg/UUID"](uuid=uuid)
        info = STORE.types["action_msgs/msg/GoalInfo"](goal_id=number, stamp=stamp)
        name = "action_msgs/msg/CancelGoal_Request"
        message = STORE.types[name](goal_info=info)
        assert data == bytes(STORE.serialize_cdr(message, name))


def test_a_goal_that_is_cancelled_while_it_is_encoded_is_never_sent() -> None:
    bridge = Bridge().offer()
    bridge.session.perform(DOCK)
    (returned,) = bridge.told()
    bridge.session.perform(CANCEL)
    assert [goal for goal, _ in bridge.cancelled()] == [ALL]
    reply = bridge.codec.received(returned).reply
    assert reply is not None
    bridge.session.perform(reply)
    assert bridge.sent() == []
    (answer,) = bridge.told()
    assert (answer.attributes["id"], answer.attributes["ok"]) == (7, False)
    assert answer.attributes["reason"] == "the action was cancelled"


def test_a_goal_of_an_earlier_connection_is_not_sent_on_the_next() -> None:
    first = Bridge().offer()
    first.session.perform(DOCK)
    (returned,) = first.told()
    later = Bridge().offer()
    reply = later.codec.received(returned).reply
    assert reply is not None
    later.session.perform(reply)
    assert later.sent() == []


def test_a_goal_that_was_sent_before_stop_is_not_encoded_any_more() -> None:
    """A robot without a command that cancels the action must not start it after STOP, either."""
    bridge = Bridge().offer()
    codec = bridge.codec
    goal = codec.sent(DOCK._replace(attributes={"action": "/dock", "id": 7}))
    assert isinstance(goal, Envelope)
    bridge.session.perform(goal)
    codec.stop_goals()
    (returned,) = bridge.told()
    found = codec.received(returned)
    assert found.reply is None
    assert found.envelope is not None
    assert found.envelope.attributes == {"id": 7, "ok": False, "reason": STOPPED}
    again = codec.sent(DOCK._replace(attributes={"action": "/dock", "id": 8}))
    assert isinstance(again, Envelope)
    bridge.session.perform(again)
    (returned,) = bridge.told()
    assert codec.received(returned).reply is not None


def test_a_goal_that_the_robot_accepts_after_its_cancellation_is_cancelled_again() -> None:
    bridge = Bridge().offer()
    call, goal = bridge.start()
    bridge.session.perform(CANCEL)
    (_, every), (_, one) = bridge.cancelled()
    bridge.reply(every, code(2))
    bridge.reply(one, code(2))
    bridge.reply(call, YES)
    assert [name for name, _ in bridge.cancelled()] == [goal]


def test_a_goal_that_is_accepted_long_after_stop_is_cancelled_at_once() -> None:
    bridge = Bridge().offer()
    call, goal = bridge.start()
    bridge.session.perform(CANCEL)
    for _ in range(60):
        for _, one in bridge.cancelled():
            bridge.reply(one, code(2))
        bridge.advance(1)
    bridge.cancelled()
    bridge.reply(call, YES)
    assert [name for name, _ in bridge.cancelled()] == [goal]
    bridge.advance(1)
    assert [name for name, _ in bridge.cancelled()] == [goal], "the repetitions begin anew"


@pytest.mark.parametrize("number", [0, 2, 3])
def test_a_reply_that_comes_before_the_acceptance_ends_no_cancellation(number: int) -> None:
    bridge = Bridge().offer()
    call, goal = bridge.start()
    bridge.session.perform(CANCEL)
    for _, one in bridge.cancelled():
        bridge.reply(one, code(number))
    bridge.reply(call, YES)
    ((name, one),) = bridge.cancelled()
    assert name == goal
    bridge.reply(one, code(0))
    bridge.advance(1)
    ((name, one),) = bridge.cancelled()
    assert name == ALL, "its reply did not count while the goal was on its way"
    bridge.reply(one, code(0))
    bridge.advance(60)
    assert bridge.cancelled() == []


def test_an_accepted_goal_that_newer_goals_displaced_is_still_cancelled() -> None:
    bridge = Bridge().offer()
    call, goal = bridge.start()
    for _ in range(MAX_GOALS):
        bridge.start()
    bridge.session.perform(CANCEL)
    assert goal not in [name for name, _ in bridge.cancelled()]
    bridge.reply(call, YES)
    assert [name for name, _ in bridge.cancelled()] == [goal]


def test_an_unknown_goal_is_cancelled_again_because_it_may_arrive_late() -> None:
    """A frozen bridge delivers the goal of a lost connection after the cancellation."""
    goals = UnfinishedGoals()
    _, goal = Bridge(goals).offer().start()
    goals.cancel("/dock")
    later = Bridge(goals).offer()
    (every, call), (name, one) = later.cancelled()
    assert (every, name) == (ALL, goal)
    later.reply(call, code(0))
    for wait_s in (1, 2, 4, 8, 10, 10, 10):
        later.reply(one, code(2))
        later.advance(wait_s - 0.1)
        assert later.cancelled() == []
        later.advance(0.1)
        ((name, one),) = later.cancelled()
        assert name == goal
    later.reply(one, code(0))
    later.advance(60)
    assert later.cancelled() == goals.cancelled() == []


def test_a_bridge_that_does_not_reply_is_asked_again_without_end() -> None:
    bridge = Bridge().offer()
    call, goal = bridge.start()
    bridge.reply(call, YES)
    bridge.session.perform(CANCEL)
    assert [name for name, _ in bridge.cancelled()] == [ALL, goal]
    times_s = []
    for _ in range(70):
        bridge.advance(1)
        if found := bridge.cancelled():
            assert sorted(name for name, _ in found) == [ALL, goal]
            times_s.append(bridge.now_s)
    assert times_s == [1, 3, 7, 15, 25, 35, 45, 55, 65]
    texts = [one.body for one in bridge.told() if one.verb == NOTICE]
    head = "the cancellation of all goals of /dock is repeated"
    assert texts[0] == f"{head}: no reply within 1 s"
    assert len(texts) == 10, "each wait is told once"


def test_a_service_that_appears_again_is_asked_at_once() -> None:
    bridge = Bridge().offer()
    call, goal = bridge.start()
    bridge.reply(call, YES)
    bridge.session.perform(CANCEL)
    for _ in range(40):
        for _, one in bridge.cancelled():
            bridge.hear({"op": "serviceCallFailure", "callId": one, "message": "not available"})
        bridge.advance(1)
    bridge.cancelled()
    bridge.hear({"op": "unadvertiseServices", "serviceIds": [10, 11, 12]})
    bridge.offer()
    assert [name for name, _ in bridge.cancelled()] == [ALL, goal]
    bridge.advance(1)
    assert [name for name, _ in bridge.cancelled()] == [ALL, goal]


def test_a_cancellation_that_fails_is_repeated_and_told() -> None:
    bridge = Bridge().offer()
    bridge.session.perform(CANCEL)
    ((_, call),) = bridge.cancelled()
    bridge.hear({"op": "serviceCallFailure", "callId": call, "message": "timed out"})
    (notice,) = bridge.told()
    text = "the cancellation of all goals of /dock is repeated: timed out"
    assert notice == Envelope(NOTICE, {}, text)
    bridge.advance(1)
    assert [name for name, _ in bridge.cancelled()] == [ALL]
    bridge.queue.end("lost")
    bridge.advance(60)
    assert bridge.sent() == []


@pytest.mark.parametrize("said", [answer(1, []), answer(0, [])], ids=["rclcpp", "rclpy"])
def test_a_refused_cancellation_is_told_and_repeated(said: bytes) -> None:
    bridge = Bridge().offer()
    call, goal = bridge.start()
    bridge.reply(call, YES)
    bridge.encode()
    bridge.sent()
    bridge.session.perform(CANCEL)
    (_, every), (_, one) = bridge.cancelled()
    bridge.reply(every, code(0))
    bridge.reply(one, said)
    (notice,) = bridge.told()
    assert notice.body == "the robot refused to cancel a goal of /dock; URC asks again"
    bridge.advance(1)
    ((name, one),) = bridge.cancelled()
    assert name == goal
    bridge.reply(one, code(0))
    bridge.advance(60)
    assert bridge.cancelled() == []


def test_the_refused_cancellation_of_all_goals_is_told_and_repeated() -> None:
    bridge = Bridge().offer()
    bridge.session.perform(CANCEL)
    bridge.reply(bridge.cancelled()[0][1], code(1))
    (notice,) = bridge.told()
    assert notice.body == "the robot refused to cancel all goals of /dock; URC asks again"
    bridge.advance(1)
    ((name, call),) = bridge.cancelled()
    assert name == ALL
    bridge.reply(call, code(2))
    bridge.advance(60)
    assert bridge.cancelled() == []


def test_the_cancellation_of_all_goals_is_answered_only_when_no_goal_can_follow() -> None:
    """A goal that is on its way, or that rclpy refuses to cancel, may drive the robot on."""
    goals = UnfinishedGoals()
    bridge = Bridge(goals).offer()
    call, goal = bridge.start()
    bridge.session.perform(CANCEL)
    (_, every), (_, one) = bridge.cancelled()
    bridge.reply(every, code(2))
    bridge.reply(one, code(2))
    assert goals.owes("/dock")
    bridge.reply(call, YES)
    bridge.encode()
    bridge.advance(1)
    calls = dict(bridge.cancelled())
    bridge.reply(calls[ALL], answer(0, []))
    bridge.reply(calls[goal], answer(0, []))
    assert goals.owes("/dock")
    bridge.advance(2)
    calls = dict(bridge.cancelled())
    bridge.reply(calls[ALL], code(0))
    assert not goals.owes("/dock")


def test_an_unanswered_cancellation_of_all_goals_is_repeated_on_the_next_connection() -> None:
    goals = UnfinishedGoals()
    Bridge(goals).offer().session.perform(CANCEL)
    later = Bridge(goals).offer()
    ((name, call),) = later.cancelled()
    assert name == ALL
    later.reply(call, code(0))
    assert Bridge(goals).offer().cancelled() == []


def test_a_new_goal_is_not_ended_by_the_cancellation_of_all_earlier_goals() -> None:
    """A person has reset STOP; the robot has still not answered."""
    goals = UnfinishedGoals()
    bridge = Bridge(goals).offer()
    bridge.session.perform(CANCEL)
    assert [name for name, _ in bridge.cancelled()] == [ALL]
    call, _ = bridge.start()
    bridge.reply(call, YES)
    bridge.advance(60)
    assert bridge.cancelled() == Bridge(goals).offer().cancelled() == []


@pytest.mark.parametrize(
    ("status", "reason"),
    [
        (4, None),
        (5, "the action was cancelled"),
        (6, "the action was aborted"),
        (9, "the action failed"),
    ],
)
def test_a_result_ends_the_goal(status: int, reason: str | None) -> None:
    goals = UnfinishedGoals()
    bridge = Bridge(goals).offer()
    call, goal = bridge.start()
    bridge.reply(call, YES)
    bridge.encode()
    ((_, call, data),) = bridge.sent()
    assert data == b"\0\1\0\0" + bytes.fromhex(goal)
    bridge.reply(call, b"\0\1\0\0" + struct.pack("<b3xf", status, 2.5))
    (raw,) = bridge.told()
    answer = bridge.codec.received(raw).envelope
    assert answer is not None
    assert answer.attributes["ok"] == (reason is None)
    assert (UNKNOWN_END in answer.attributes) == (status == 9)
    assert answer.attributes.get("reason") == reason
    assert answer.body == {"way": 2.5}
    assert goals.cancel("/dock") == []


def test_a_rejected_goal_is_not_kept() -> None:
    goals = UnfinishedGoals()
    bridge = Bridge(goals).offer()
    call, _ = bridge.start()
    bridge.reply(call, NO)
    (answer,) = bridge.told()
    assert answer.attributes["reason"] == "the action was rejected"
    assert UNKNOWN_END not in answer.attributes
    assert goals.cancel("/dock") == []


def test_a_goal_without_an_answer_is_kept_for_stop() -> None:
    goals = UnfinishedGoals()
    bridge = Bridge(goals).offer()
    call, goal = bridge.start()
    bridge.hear({"op": "serviceCallFailure", "callId": call, "message": "timed out"})
    (answer,) = bridge.told()
    assert answer.attributes["reason"] == "timed out"
    assert answer.attributes[UNKNOWN_END] is True
    assert goals.cancel("/dock") == [goal]


@pytest.mark.parametrize("case", ["no service", "a failed call", "an unreadable type"])
def test_the_end_of_an_accepted_goal_without_a_result_is_unknown(
    case: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if case == "an unreadable type":
        monkeypatch.setitem(TEXTS, "get_result", ("no/Such thing", "int8 status"))
    goals = UnfinishedGoals()
    bridge = Bridge(goals).offer()
    call, goal = bridge.start()
    if case == "no service":
        bridge.hear({"op": "unadvertiseServices", "serviceIds": [11]})
    bridge.reply(call, YES)
    (told,) = bridge.told()
    found = bridge.codec.received(told)
    if case == "a failed call":
        assert found.reply is not None
        bridge.session.perform(found.reply)
        ((_, call, _),) = bridge.sent()
        bridge.hear({"op": "serviceCallFailure", "callId": call, "message": "timed out"})
        (told,) = bridge.told()
        found = bridge.codec.received(told)
    answer = found.envelope
    assert answer is not None
    assert (answer.attributes["id"], answer.attributes["ok"]) == (7, False)
    assert answer.attributes[UNKNOWN_END] is True
    assert goals.cancel("/dock") == [goal]


@pytest.mark.parametrize(
    ("names", "action", "expected"),
    [
        ((), "/dock", HIDDEN),
        (("get_result", "cancel_goal"), "/dock", HIDDEN),
        (("send_goal", "cancel_goal"), "/undock", "there is no action /undock"),
        (
            ("send_goal", "get_result"),
            "/dock",
            "the bridge offers no service that cancels /dock, so no goal is sent",
        ),
    ],
)
def test_without_the_services_for_starting_and_cancelling_no_goal_is_sent(
    names: tuple[str, ...], action: str, expected: str
) -> None:
    bridge = Bridge()
    if names:
        bridge.offer(*names)
    bridge.session.perform(DOCK._replace(attributes={"action": action, "id": 7}))
    assert bridge.told() == [], "the services may be announced a moment later"
    bridge.advance(1)
    (answer,) = bridge.told()
    assert (answer.attributes["ok"], answer.attributes["reason"]) == (False, expected)
    assert bridge.sent() == []


def test_a_goal_that_never_ends_is_cancelled_when_the_service_appears() -> None:
    """A reconnected bridge announces its services a moment later."""
    goals = UnfinishedGoals()
    _, goal = Bridge(goals).offer().start()
    later = Bridge(goals)
    later.session.perform(CANCEL)
    assert later.sent() == []
    later.offer("cancel_goal")
    assert [name for name, _ in later.cancelled()] == [ALL, goal]
    assert later.told() == []


def test_a_restarted_server_cancels_goals_that_it_does_not_know() -> None:
    """STOP is owed across a restart; its cancellation comes before the services are known."""
    bridge = Bridge()
    bridge.session.perform(CANCEL)
    bridge.offer()
    assert [name for name, _ in bridge.cancelled()] == [ALL]


def test_a_cancellation_waits_for_its_service_and_says_so_once() -> None:
    bridge = Bridge()
    for _ in range(2):  # the second one adds no line to the log
        bridge.session.perform(CANCEL)
        bridge.advance(1)
    (notice,) = bridge.told()
    text = "the goals of /dock are not cancelled yet: the bridge offers no service for that"
    assert notice == Envelope(NOTICE, {}, text)
    bridge.advance(600)
    bridge.offer()
    assert [name for name, _ in bridge.cancelled()] == [ALL]


def test_a_goal_waits_for_its_services_and_stop_ends_the_wait() -> None:
    bridge = Bridge()
    bridge.session.perform(DOCK)
    bridge.offer()
    bridge.advance(1)
    bridge.encode()
    assert [name for name, _, _ in bridge.sent()] == ["send_goal"]
    other = Bridge()
    other.session.perform(DOCK)
    other.session.perform(CANCEL)
    other.offer()
    assert [name for name, _ in other.cancelled()] == [ALL]
    other.advance(1.0)
    (answer,) = [one for one in other.told() if one.verb != NOTICE]
    assert answer.attributes["reason"] == "the action was cancelled"
    assert {name for name, _, _ in other.sent()} == {"cancel_goal"}


@pytest.mark.parametrize("data", [b"", b"\0\1\0\0", b"{", b'{"accepted":[]}'])
@pytest.mark.parametrize("encoding", ["cdr", "json"])
def test_a_reply_that_is_none_breaks_nothing(data: bytes, encoding: str) -> None:
    bridge = Bridge(encoding=encoding).offer()
    bridge.session.perform(DOCK)
    bridge.encode()
    ((_, call, _),) = bridge.sent()
    bridge.reply(call, data)
    bridge.session.perform(CANCEL)
    for _, call, _ in bridge.sent():
        bridge.reply(call, data)

"""Goals over rosbridge: their ids, and their cancellation from a later connection."""

import asyncio
import json
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest

from urc.model.payload import LOST, Envelope
from urc.transports.base import GoalRecord, PeerClosed
from urc.transports.ros.goals import LATE, MAX_GOALS, UnfinishedGoals
from urc.transports.ros.rosbridge_client import RosClient, RosSubscription
from urc.transports.topic_queue import TopicReceiveQueue

DOCK = Envelope("goal", {"action": "/dock", "type": "a/action/Dock", "id": 7}, {})
CANCEL = Envelope("cancel", {"action": "/dock"})


def sent(client: RosClient, envelope: Envelope) -> list[dict[str, Any]]:
    return [json.loads(frame) for frame in client.perform(envelope)]


def ended(goal: dict[str, Any], status: int) -> dict[str, Any]:
    said = {"op": "action_result", "id": goal["id"], "action": "/dock", "values": {}}
    return {**said, "status": status, "result": status == 4}


def told(queue: TopicReceiveQueue) -> list[Envelope]:
    """Return the queued envelopes, up to the end of the connection."""

    async def take() -> list[Envelope]:
        queue.end("over")
        found: list[Envelope] = []
        with suppress(PeerClosed):
            while True:
                found.append(await queue.pop())
        return found

    return asyncio.run(take())


def test_a_later_connection_cancels_the_goals_of_an_earlier_one() -> None:
    goals = UnfinishedGoals()
    (first,) = sent(RosClient(TopicReceiveQueue(), 2, goals), DOCK)
    later = RosClient(queue := TopicReceiveQueue(), 2, goals)
    (second,) = sent(later, DOCK)
    sent(later, DOCK._replace(attributes={**DOCK.attributes, "action": "/undock"}))
    assert sent(later, CANCEL) == [
        {"op": "cancel_action_goal", "id": one["id"], "action": "/dock"} for one in (first, second)
    ]
    assert told(queue) == []


def test_a_cancel_without_a_result_is_sent_again_on_the_next_connection() -> None:
    """The lost connection accepted the frame; STOP counts as sent, and is not repeated."""
    goals = UnfinishedGoals()
    first = RosClient(TopicReceiveQueue(), 2, goals)
    ending, lasting = sent(first, DOCK) + sent(first, DOCK)
    sent(first, DOCK._replace(attributes={**DOCK.attributes, "action": "/undock"}))
    assert first.cancel_due() == [], "nothing was cancelled yet"
    assert first.cancel_wait_s() is None
    sent(first, CANCEL)
    first.arrived(ended(ending, 5), 100)
    (again,) = map(json.loads, RosClient(TopicReceiveQueue(), 2, goals).cancel_due())
    assert again == {"op": "cancel_action_goal", "id": lasting["id"], "action": "/dock"}


def test_a_cancel_is_repeated_until_the_result_arrives() -> None:
    """The bridge drops a cancel that its thread handles before the thread of the goal."""
    now_s = 100.0
    client = RosClient(TopicReceiveQueue(), 2, UnfinishedGoals(), lambda: now_s)
    (goal,) = sent(client, DOCK)
    (cancel,) = sent(client, CANCEL)
    times_s = []
    for _ in range(460):
        wait_s = client.cancel_wait_s()
        assert wait_s is not None
        frames = [json.loads(frame) for frame in client.cancel_due()]
        assert frames in ([], [cancel])
        assert bool(frames) == (wait_s == 0)
        times_s += [now_s - 100] * bool(frames)
        now_s += 0.125
    assert times_s == [1, 3, 7, 15, 25, 35, 45, 55]
    client.arrived(ended(goal, 5), 100)
    now_s += 60
    assert client.cancel_wait_s() is None
    assert client.cancel_due() == []


def test_a_goal_of_the_other_kind_of_bridge_is_not_cancelled_by_its_id() -> None:
    goals = UnfinishedGoals()
    goals.add("0f" * 16, "/dock")
    client = RosClient(TopicReceiveQueue(), 2, goals)
    assert sent(client, CANCEL) == client.cancel_due() == []
    assert goals.owes("/dock"), "foxglove_bridge ends it later"
    sent(client, DOCK)
    assert not goals.owes("/dock"), "the new goal must not be ended"


@pytest.mark.parametrize("is_reply_first", [False, True])
def test_the_robots_reply_and_the_results_of_all_goals_answer_the_cancellation(
    is_reply_first: bool,
) -> None:
    """The reply proves nothing about a goal that the bridge has not passed on yet."""
    goals = UnfinishedGoals()
    client = RosClient(TopicReceiveQueue(), 2, goals)
    first, second = sent(client, DOCK) + sent(client, DOCK)
    sent(client, DOCK._replace(attributes={**DOCK.attributes, "action": "/undock"}))
    for action in ("/dock", "/undock"):
        sent(client, CANCEL._replace(attributes={"action": action}))
    if is_reply_first:
        assert client.all_cancelled("/dock", True)
        assert not client.owes("/dock"), "it need not be repeated"
    for goal in (first, second):
        assert goals.owes("/dock")
        client.arrived(ended(goal, 5), 100)
    if not is_reply_first:
        assert client.owes("/dock")
        assert client.all_cancelled("/dock", False)
    assert goals.owed() == ["/undock"]


def test_a_reply_without_goals_is_no_answer_while_a_goal_goes_on() -> None:
    """rclpy reports a refusal as success without goals."""
    goals = UnfinishedGoals()
    client = RosClient(TopicReceiveQueue(), 2, goals)
    sent(client, DOCK)
    sent(client, CANCEL)
    assert not client.all_cancelled("/dock", False)
    assert client.owes("/dock")


def test_the_robots_reply_alone_answers_for_goals_of_earlier_connections() -> None:
    """Their results never arrive here; the cancellations of their ids are repeated all the same."""
    goals = UnfinishedGoals()
    (goal,) = sent(RosClient(TopicReceiveQueue(), 2, goals), DOCK)
    later = RosClient(TopicReceiveQueue(), 2, goals)
    sent(later, CANCEL)
    assert later.all_cancelled("/dock", False)
    assert not goals.owes("/dock")
    assert goals.cancelled() == [(goal["id"], "/dock")]


def test_a_later_cancellation_needs_an_answer_of_its_own() -> None:
    goals = UnfinishedGoals()
    client = RosClient(TopicReceiveQueue(), 2, goals)
    (goal,) = sent(client, DOCK)
    sent(client, CANCEL)
    assert client.all_cancelled("/dock", True)
    sent(client, CANCEL)
    assert client.owes("/dock")
    client.arrived(ended(goal, 5), 100)
    assert goals.owes("/dock")


def test_without_the_robots_reply_no_cancellation_is_answered() -> None:
    goals = UnfinishedGoals()
    client = RosClient(TopicReceiveQueue(), 2, goals)
    (goal,) = sent(client, DOCK)
    client.arrived(ended(goal, 4), 100)
    sent(client, CANCEL)
    assert goals.owes("/dock"), "another program may have sent a goal"


def test_the_record_reports_each_change_and_continues_in_another_process() -> None:
    told: list[GoalRecord] = []
    goals = UnfinishedGoals()
    goals.keep(GoalRecord(), told.append)
    goals.add("a", "/dock")
    assert told == [GoalRecord((("a", "/dock", False),))]
    goals.cancel("/dock")
    goals.add("b", "/undock")
    goals.cancel_late("c", "/undock")
    goals.finish("nothing")
    goals.settle("/undock")
    last = GoalRecord(
        (("a", "/dock", True), ("b", "/undock", False), ("c", "/undock", True)), ("/dock",)
    )
    assert told[-1] == last
    assert len(told) == 5, "what changes nothing is not reported"
    later = UnfinishedGoals()
    later.keep(last, told.append)
    assert later.record == last
    later.settle("/dock")
    for goal in "abc":
        later.finish(goal)
    assert told[-1] == GoalRecord()


@pytest.mark.parametrize("status", [4, 5, 6])
def test_an_ended_goal_is_not_cancelled_by_its_id(status: int) -> None:
    client = RosClient(queue := TopicReceiveQueue(), 2, UnfinishedGoals())
    (goal,) = sent(client, DOCK)
    client.arrived(ended(goal, status), 100)
    assert sent(client, CANCEL) == sent(client, CANCEL) == []
    (response,) = told(queue)
    assert (response.verb, response.attributes["id"]) == ("response", 7)


def test_two_connections_use_different_ids() -> None:
    """The bridge keeps goals by id for all clients; a repeated id would replace a running goal."""
    call = Envelope("call", {"service": "/a", "id": 1}, {})
    ids = [
        one["id"]
        for _ in range(20)
        for client in [RosClient(TopicReceiveQueue(), 2)]
        for one in sent(client, DOCK) + sent(client, DOCK) + sent(client, call)
    ]
    assert len(set(ids)) == len(ids) == 60


def test_kept_goals_are_bounded_and_the_newest_stay() -> None:
    goals = UnfinishedGoals()
    for number in range(MAX_GOALS + 5):
        goals.add(str(number), "/dock")
    assert goals.cancel("/dock") == [str(number) for number in range(5, MAX_GOALS + 5)]


@pytest.mark.parametrize(("status", "reason"), [(4, None), (5, "cancelled"), (6, "aborted")])
def test_the_status_of_a_goal_counts_more_than_its_result(status: int, reason: str | None) -> None:
    """rosbridge_suite reports `result: true` for each goal that has ended."""
    client = RosClient(queue := TopicReceiveQueue(), 2, UnfinishedGoals())
    (goal,) = sent(client, DOCK)
    client.arrived({**ended(goal, status), "result": True}, 100)
    (response,) = told(queue)
    assert response.attributes["ok"] == (reason is None)
    expected = None if reason is None else f"the action was {reason}"
    assert response.attributes.get("reason") == expected


def test_a_new_goal_ends_the_cancellation_of_all_goals_without_an_answer() -> None:
    """Nothing proves the end of the earlier goals, so they do not count as ended."""
    told: list[GoalRecord] = []
    goals = UnfinishedGoals()
    goals.keep(GoalRecord(), told.append)
    client = RosClient(TopicReceiveQueue(), 2, goals)
    sent(client, CANCEL)
    sent(client, DOCK)
    assert (told[-1].owed, told[-1].dropped) == ((), ("/dock",))
    sent(client, CANCEL)
    assert (told[-1].owed, told[-1].dropped) == (("/dock",), ())
    client.arrived(ended({"id": goals.cancelled()[0][0]}, 5), 100)
    assert client.all_cancelled("/dock", False)
    assert (told[-1].owed, told[-1].dropped) == ((), ())


def late(prepare: Callable[[RosClient, UnfinishedGoals], None], status: int = 5) -> object:
    """Return why a goal has ended that was sent after `prepare`."""
    goals = UnfinishedGoals()
    client = RosClient(queue := TopicReceiveQueue(), 2, goals)
    prepare(client, goals)
    (goal,) = sent(client, DOCK)
    client.arrived(ended(goal, status), 100)
    (response,) = told(queue)
    return response.attributes.get("reason")


def unanswered(client: RosClient, goals: UnfinishedGoals) -> None:
    """Cancel all goals of /dock by a call whose reply has not arrived."""
    sent(client, CANCEL)
    goals.called("/dock")


def answered(client: RosClient, goals: UnfinishedGoals) -> None:
    """Cancel all goals of /dock by a call that the robot answers."""
    unanswered(client, goals)
    goals.replied("/dock")


def test_a_goal_that_a_late_cancellation_may_have_ended_says_so() -> None:
    """The bridge can handle an unanswered call late, and then it ends newer goals, too."""
    assert late(unanswered) == LATE
    assert late(answered) == "the action was cancelled"
    assert late(unanswered, 6) == "the action was aborted"
    assert late(lambda client, goals: goals.called("/undock")) == "the action was cancelled"


def test_a_goal_that_the_operator_cancels_is_not_called_a_late_end() -> None:
    goals = UnfinishedGoals()
    client = RosClient(queue := TopicReceiveQueue(), 2, goals)
    unanswered(client, goals)
    (goal,) = sent(client, DOCK)
    sent(client, CANCEL)
    client.arrived(ended(goal, 5), 100)
    (response,) = told(queue)
    assert response.attributes["reason"] == "the action was cancelled"


def test_with_simulated_time_goals_and_calls_carry_it_instead_of_now() -> None:
    """Otherwise, the bridge replaces the word; its own clock may not be the simulation's."""
    route = {"poses": [{"header": {"stamp": "now"}}, {"header": {"stamp": "now"}}]}
    goal = DOCK._replace(body=route)
    call = Envelope("call", {"service": "/plan", "id": 8}, route)
    for clock_only in (None, True):
        client = RosClient(TopicReceiveQueue(), 2, clock_only=clock_only)
        client.listen(RosSubscription("/clock", "rosgraph_msgs/msg/Clock"))
        clock = {"clock": {"sec": 7, "nanosec": 8}}
        client.arrived({"op": "publish", "topic": "/clock", "msg": clock}, 100)
        stamp = "now" if clock_only is None else clock["clock"]
        for envelope in (goal, call):
            (said,) = sent(client, envelope)
            assert said["args"] == {"poses": [{"header": {"stamp": stamp}}] * 2}


def test_other_topics_than_videos_are_told_of_no_subscription() -> None:
    client = RosClient(queue := TopicReceiveQueue(), 2, UnfinishedGoals())
    client.listen(RosSubscription("/odom", "nav_msgs/Odometry"))
    client.arrived({"op": "publish", "topic": "/odom", "msg": {}}, 100)
    assert [LOST in one.attributes for one in told(queue)] == [False]


def test_a_video_is_told_of_each_subscription() -> None:
    """A pause leaves out messages, without which the next ones cannot be decoded."""
    client = RosClient(queue := TopicReceiveQueue(), 2, UnfinishedGoals())
    client.listen(RosSubscription("/film", "foxglove.CompressedVideo"))

    async def heard() -> bool:
        client.arrived({"op": "publish", "topic": "/film", "msg": {}}, 100)
        return LOST in (await queue.pop()).attributes

    async def play() -> list[bool]:
        found = [await heard(), await heard()]
        client.pause("/film")
        client.resume("/film")
        return [*found, await heard(), await heard()]

    assert asyncio.run(play()) == [True, False, True, False]

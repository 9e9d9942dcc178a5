"""One client of the Foxglove server: what is sent, what is dropped, and what closes the socket."""

import asyncio
import json
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, contextmanager, nullcontext
from typing import Any

import pytest

from tests.unit.web.test_client import FakeLine
from urc.model.driver import Argument, Command, Hold
from urc.model.interface import WidgetUse
from urc.model.role import Role, includes
from urc.model.values import Reading, Sample, Signal
from urc.motion.lease import Operator
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.audit_recorder import AuditRecorder
from urc.runtime.contact_times import NO_CONTACT
from urc.runtime.server_recorder import ServerRecorder
from urc.testing.clock import FakeClock, settle
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.profile import text
from urc.transports.ros.foxglove_frames import FrameReader, MessageData, ServiceReply, call_frame
from urc.web.api.robots import RobotCalls
from urc.web.feed.client_socket import SocketPeer
from urc.web.fleet.robots import Robot, RobotService
from urc.web.foxglove import client as module
from urc.web.foxglove.calls import FoxgloveCalls
from urc.web.foxglove.client import (
    MESSAGES_PER_S,
    MOST_FAULTS,
    RETRY_S,
    FoxgloveClient,
)
from urc.web.foxglove.offers import Offers, OfferSource, RobotCatalogue
from urc.web.foxglove.outbox import DROPPED_EVERY_S, MOST_ANSWERS
from urc.web.foxglove.robot_feed import MOST_WAITING
from urc.web.foxglove.topics import HubMessages
from urc.web.wire.messages import CLOSE_BAD_MESSAGES, CLOSE_NOT_LET_IN, CLOSE_TOO_FAST

pytestmark = pytest.mark.anyio

SIGNALS = {
    "battery": Signal("battery", "integer", unit="%"),
    "mode": Signal("mode", "string"),
    "camera": Signal("camera", "image"),
    "frames": Signal("frames", "transform_tree"),
    "x": Signal("x", unit="m"),
    "y": Signal("y", unit="m"),
}
MAP = WidgetUse("place", "map", {"x": "x", "y": "y"})
SPEED = Argument("speed", "number", min=-1, max=1)
COMMANDS = {
    "say": Command("say", "wire", text("say"), arguments={"word": Argument("word", "string")}),
    "tune": Command("tune", "wire", text("tune"), role="maintain"),
    "drive": Command(
        "drive",
        "wire",
        text("drive"),
        arguments={"speed": SPEED},
        hold=Hold(0.05, release={"speed": 0}),
    ),
}
JPEG = b"\xff\xd8\xff picture "


class ChangingRights:
    """Rights that a test can change."""

    def __init__(self, role: Role | None) -> None:
        self.now = role

    def role(self) -> Role | None:
        return self.now

    def may_give(self, command: str) -> bool:
        return True

    def limit(self) -> str:
        return ""


class Viewer:
    """A client that is connected to the server of one fake robot."""

    def __init__(self, role: Role | None) -> None:
        self.clock = FakeClock()
        profile = dashboard_profile(signals=SIGNALS, commands=COMMANDS, uses=(MAP,))
        self.robot = FakeRobot(profile, self.clock)
        self.audit: list[AuditEntry] = []
        self.services: dict[str, RobotService] = {"puppet": self.service(self.robot)}
        self.rights = ChangingRights(role)
        self.line = FakeLine()
        self.calls = RobotCalls(
            lambda: self.services, lambda _: nullcontext(), lambda _: NO_CONTACT
        )
        self.hubs: dict[Any, HubMessages] = {}
        self.task: asyncio.Task[None]
        self.client = FoxgloveClient(
            self.line,
            self.line,
            Offers(self.source()),
            FoxgloveCalls(
                self.calls.run,
                lambda _: Operator("", "viewer", self.rights.now),
                ServerRecorder(lambda _: None),
            ),
            self.clock,
            session="s",
        )

    def service(self, robot: FakeRobot) -> RobotService:
        recorder = AuditRecorder("puppet", self.audit.append, utc=lambda: 99.0)
        served = Robot(robot.profile, {}, robot.open)
        return RobotService(served, clock=self.clock, recorder=recorder)

    def source(self) -> OfferSource:
        return OfferSource(
            lambda: self.services,
            may_watch=lambda _: includes(self.rights.now, "watch"),
            is_let_in=lambda: self.rights.now is not None,
            peer=lambda *_: SocketPeer(who="viewer", is_known=True, rights=self.rights),
            messages=lambda hub, name, _: self.hubs.setdefault(
                hub, HubMessages(name, self.robot.profile, lambda time_s: round(time_s * 1e9))
            ),
            catalogue=RobotCatalogue(),
        )

    # -- what the server said

    @property
    def said(self) -> list[dict[str, Any]]:
        return self.line.sent

    def of(self, op: str) -> list[dict[str, Any]]:
        return [one for one in self.said if one["op"] == op]

    def channel(self, topic: str) -> int:
        found = [one for said in self.of("advertise") for one in said["channels"]]
        number: int = [one["id"] for one in found if one["topic"] == topic][-1]
        return number

    def service_id(self, name: str) -> int:
        found = [one for said in self.of("advertiseServices") for one in said["services"]]
        number: int = [one["id"] for one in found if one["name"] == name][-1]
        return number

    def messages(self, subscription: int) -> list[Any]:
        read = [FrameReader().read(one) for one in self.line.frames]
        found = [one for one in read if isinstance(one, MessageData)]
        return [json.loads(one.data) for one in found if one.subscription == subscription]

    def replies(self) -> dict[int, Any]:
        read = [FrameReader().read(one) for one in self.line.frames]
        return {one.call: json.loads(one.data) for one in read if isinstance(one, ServiceReply)}

    def failures(self) -> dict[int, str]:
        return {one["callId"]: one["message"] for one in self.of("serviceCallFailure")}

    # -- what the client says

    async def say(self, op: str, **more: object) -> None:
        self.line.say({"op": op, **more})
        await settle()

    async def subscribe(self, topic: str, subscription: int) -> None:
        wanted = {"id": subscription, "channelId": self.channel(topic)}
        await self.say("subscribe", subscriptions=[wanted])

    async def send(self, data: bytes) -> None:
        self.line.receiver.put_nowait({"type": "websocket.receive", "bytes": data})
        await settle()

    async def call(self, name: str, number: int, request: Mapping[str, object]) -> None:
        data = json.dumps(request).encode()
        await self.send(call_frame(self.service_id(name), number, "json", data))

    async def reading(self, signal: str, value: Reading) -> None:
        self.robot.set_reading(signal, value)
        await settle()

    @contextmanager
    def deaf(self) -> Any:
        self.line.free.clear()
        yield
        self.line.free.set()


@asynccontextmanager
async def viewer(role: Role | None = "drive") -> AsyncIterator[Viewer]:
    made = Viewer(role)
    running = [asyncio.create_task(one.run()) for one in made.services.values()]
    task = made.task = asyncio.create_task(made.client.serve())
    await settle()
    try:
        yield made
    finally:
        made.line.free.set()
        made.line.leave()
        await asyncio.wait((task,), timeout=5)
        assert task.done()
        task.result()
        for one in running:
            one.cancel()
        await asyncio.gather(*running, return_exceptions=True)


# ---- subscriptions


async def test_a_client_first_learns_of_the_server_then_of_the_channels() -> None:
    async with viewer() as seen:
        assert [one["op"] for one in seen.said] == ["serverInfo", "advertise", "advertiseServices"]
        topics = [one["topic"] for one in seen.of("advertise")[0]["channels"]]
        assert topics == [
            "/puppet/battery",
            "/puppet/mode",
            "/puppet/camera",
            "/puppet/frames",
            "/puppet/x",
            "/puppet/y",
            "/puppet/urc/widget/place",
            "/puppet/urc/transforms",
            "/puppet/urc/log",
            "/puppet/urc/link/wire",
        ]


async def test_a_robot_is_connected_only_while_a_channel_is_subscribed() -> None:
    async with viewer() as seen:
        assert not seen.robot.is_open
        await seen.subscribe("/puppet/battery", 4)
        assert seen.robot.is_open
        await seen.say("unsubscribe", subscriptionIds=[4])
        await seen.clock.advance(5)
        assert not seen.robot.is_open
        assert seen.client.faults == 0


async def test_only_subscribed_signals_are_sent() -> None:
    async with viewer() as seen:
        await seen.subscribe("/puppet/battery", 4)
        await seen.reading("mode", "auto")
        await seen.reading("battery", 41)
        await seen.reading("battery", 42)
        assert seen.messages(4) == [{"value": 41}, {"value": 42}]
        assert len(seen.line.frames) == 2
        await seen.say("unsubscribe", subscriptionIds=[4])
        await seen.reading("battery", 43)
        assert len(seen.line.frames) == 2


async def test_a_new_subscription_gets_the_newest_known_value() -> None:
    async with viewer() as seen:
        await seen.subscribe("/puppet/mode", 1)
        await seen.reading("battery", 40)
        await seen.subscribe("/puppet/battery", 2)
        assert seen.messages(2) == [{"value": 40}]


async def test_the_time_of_a_message_is_the_time_of_the_reading() -> None:
    async with viewer() as seen:
        await seen.subscribe("/puppet/battery", 1)
        seen.robot.set_reading("battery", 5, age_s=0.25)
        await settle()
        read = FrameReader().read(seen.line.frames[-1])
        assert isinstance(read, MessageData)
        assert read.time_ns == round((seen.clock.now() - 0.25) * 1e9)


async def test_log_and_connections_are_topics() -> None:
    async with viewer() as seen:
        await seen.subscribe("/puppet/urc/log", 1)
        await seen.subscribe("/puppet/urc/link/wire", 2)
        seen.robot.log("hello")
        seen.robot.link("lost", "gone")
        await settle()
        assert [(one["level"], one["message"]) for one in seen.messages(1)] == [(2, "hello")]
        assert [one["state"] for one in seen.messages(2)] == ["live", "lost"]


async def test_a_picture_is_a_compressed_image() -> None:
    async with viewer() as seen:
        await seen.subscribe("/puppet/camera", 1)
        await seen.reading("camera", JPEG)
        (picture,) = seen.messages(1)
        assert picture["format"] == "jpeg"
        assert picture["frame_id"] == "camera"


async def test_a_pose_is_sent_once_for_all_its_signals() -> None:
    async with viewer() as seen:
        await seen.subscribe("/puppet/urc/widget/place", 1)
        now_s = seen.clock.now()
        seen.robot.hub.publish([Sample("x", 1.5, now_s), Sample("y", -2.0, now_s)])
        await seen.reading("battery", 1)
        await seen.reading("y", 3.0)
        places = [one["pose"]["position"] for one in seen.messages(1)]
        assert [(one["x"], one["y"]) for one in places] == [(1.5, -2.0), (1.5, 3.0)]


def tree(x: float) -> dict[str, Any]:
    """Return the value of a transform tree."""
    row = {"name": "odom", "parent": "map", "depth": 1, "age": 0.0}
    place = {"translation": (x, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0)}
    return {"frames": ({"name": "map", "parent": "", "depth": 0}, {**row, **place})}


async def test_the_transforms_of_a_robot_are_a_topic_that_begins_with_the_newest() -> None:
    """Frames have the names that the messages of widgets have."""
    async with viewer() as seen:
        await seen.subscribe("/puppet/battery", 3)
        await seen.reading("frames", tree(1.0))
        await seen.subscribe("/puppet/urc/transforms", 1)
        await seen.subscribe("/puppet/frames", 2)
        await seen.reading("frames", tree(2.5))
        await seen.reading("frames", {"frames": ()})
        found = [one for message in seen.messages(1) for one in message["transforms"]]
        assert [one["translation"]["x"] for one in found] == [1.0, 2.5]
        assert {one["parent_frame_id"] for one in found} == {"puppet/map"}
        assert len(seen.messages(2)) == 3, "the tree itself is a topic, too"
        assert seen.messages(3) == []


async def test_a_slow_client_gets_the_newest_readings_and_is_told_what_it_missed() -> None:
    async with viewer() as seen:
        await seen.subscribe("/puppet/battery", 1)
        await seen.subscribe("/puppet/camera", 2)
        with seen.deaf():
            for value in range(100):
                await seen.reading("battery", value)
            for number in range(10):
                await seen.reading("camera", JPEG + bytes([number]))
            assert seen.messages(1) == []
        await settle()
        assert [one["value"] for one in seen.messages(1)] == [*range(100 - MOST_WAITING, 100)]
        assert len(seen.messages(2)) == 1
        (status,) = seen.of("status")
        dropped = 100 - MOST_WAITING + 9
        assert status["id"] == "dropped"
        assert status["level"] == 1
        assert status["message"].startswith(f"{dropped} messages were dropped")


async def test_dropped_messages_are_reported_at_most_once_in_a_while() -> None:
    async with viewer() as seen:
        await seen.subscribe("/puppet/battery", 1)
        for _ in range(3):
            with seen.deaf():
                for value in range(2 * MOST_WAITING):
                    await seen.reading("battery", value)
            await settle()
        assert len(seen.of("status")) == 1
        await seen.clock.advance(DROPPED_EVERY_S)
        await seen.reading("battery", 1)
        assert seen.of("status")[-1]["message"].startswith(f"{3 * MOST_WAITING} messages")


async def test_a_client_that_reads_nothing_is_disconnected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "STALL_S", 0.02)
    async with viewer() as seen:
        await seen.subscribe("/puppet/battery", 1)
        seen.line.free.clear()
        await seen.reading("battery", 1)
        await asyncio.wait((seen.task,), timeout=5)
        assert seen.line.was_aborted


async def test_the_end_of_a_session_is_followed_by_the_next_session() -> None:
    async with viewer() as seen:
        await seen.subscribe("/puppet/battery", 1)
        await seen.reading("battery", 1)
        service = seen.services["puppet"]
        service.replace(service.robot)
        await seen.clock.advance(2 * RETRY_S)
        assert seen.robot.opened == 2
        await seen.reading("battery", 2)
        assert [one["value"] for one in seen.messages(1)] == [1, 2]


async def test_each_state_of_a_connection_is_sent_after_a_new_session_too() -> None:
    async with viewer() as seen:
        await seen.subscribe("/puppet/urc/link/wire", 1)
        seen.robot.link("silent", "one")
        await settle()
        seen.services["puppet"].replace(seen.services["puppet"].robot)
        await seen.clock.advance(2 * RETRY_S)
        for detail in ("two", "three"):
            seen.robot.link("silent", detail)
            await settle()
        details = [one["detail"] for one in seen.messages(1)]
        assert details == ["", "one", "", "two", "three"]


async def test_an_added_robot_and_a_removed_robot_are_announced() -> None:
    async with viewer() as seen:
        await seen.subscribe("/puppet/battery", 1)
        seen.services["second"] = seen.service(FakeRobot(dashboard_profile(), seen.clock))
        await seen.clock.advance(RETRY_S)
        assert seen.channel("/second/battery")
        ended = seen.channel("/puppet/battery")
        del seen.services["puppet"]
        await seen.clock.advance(RETRY_S)
        assert ended in seen.of("unadvertise")[0]["channelIds"]
        assert seen.of("unadvertiseServices")
        # A viewer ends its subscription after the channel, and may ask once more: no fault.
        await seen.say("unsubscribe", subscriptionIds=[1])
        await seen.say("subscribe", subscriptions=[{"id": 2, "channelId": ended}])
        assert seen.client.faults == 0


# ---- faults


async def test_faults_are_counted_reported_and_limited() -> None:
    async with viewer() as seen:
        await seen.subscribe("/puppet/battery", 1)
        battery = seen.channel("/puppet/battery")
        await seen.say("subscribe", subscriptions=[{"id": 2, "channelId": 999}] * 500)
        assert seen.of("status")[-1]["message"] == "there is no channel 999 (and 499 more)"
        await seen.say("subscribe", subscriptions=[{"id": 1, "channelId": battery}])
        await seen.say("subscribe", subscriptions=[{"id": 3, "channelId": battery}])
        await seen.say("unsubscribe", subscriptionIds=[77])
        await seen.say("advertise", channels=[])
        await seen.send(b"\xff")
        assert seen.client.faults == 6
        assert seen.line.closed is None
        for _ in range(MOST_FAULTS):
            await seen.send(b"\xff")
        assert seen.line.closed is not None
        assert seen.line.closed[0] == CLOSE_BAD_MESSAGES


async def test_a_flood_closes_the_socket() -> None:
    async with viewer() as seen:
        for _ in range(MESSAGES_PER_S + 1):
            seen.line.say({"op": "unsubscribe", "subscriptionIds": []})
        await settle()
        assert seen.line.closed is not None
        assert seen.line.closed[0] == CLOSE_TOO_FAST


async def test_unread_answers_close_the_socket_instead_of_filling_the_memory() -> None:
    async with viewer() as seen:
        with seen.deaf():
            for number in range(100):
                await seen.send(call_frame(seen.service_id("/puppet/say"), number, "xml", b""))
        await settle()
        assert seen.line.closed is not None
        assert seen.line.closed[0] == CLOSE_TOO_FAST
        assert len(seen.failures()) <= MOST_ANSWERS


# ---- rights


async def test_a_watcher_is_offered_no_command_but_stop() -> None:
    async with viewer("watch") as seen:
        (said,) = seen.of("advertiseServices")
        assert [one["name"] for one in said["services"]] == ["/puppet/STOP"]


async def test_services_follow_the_role() -> None:
    async with viewer() as seen:
        names = [one["name"] for one in seen.of("advertiseServices")[0]["services"]]
        assert names == ["/puppet/say", "/puppet/STOP"]
        seen.rights.now = "maintain"
        seen.client.recheck()
        await settle()
        names = [one["name"] for one in seen.of("advertiseServices")[1]["services"]]
        assert names == ["/puppet/tune"]
        tune = seen.service_id("/puppet/tune")
        seen.rights.now = "drive"
        seen.client.recheck()
        await settle()
        assert seen.of("unadvertiseServices")[0]["serviceIds"] == [tune]


async def test_a_revoked_right_closes_the_socket() -> None:
    async with viewer() as seen:
        await seen.subscribe("/puppet/battery", 1)
        seen.rights.now = None
        seen.client.recheck()
        await settle()
        assert seen.line.closed is not None
        assert seen.line.closed[0] == CLOSE_NOT_LET_IN
        await seen.reading("battery", 9)
        assert seen.messages(1) == []


# ---- calls


async def test_a_call_runs_the_command_and_is_audited() -> None:
    async with viewer() as seen:
        seen.robot.on_command = lambda *_: {"level": 7}
        await seen.call("/puppet/say", 3, {"word": "hello"})
        assert seen.robot.commands == [("say", {"word": "hello"})]
        assert seen.replies() == {3: {"level": 7}}
        assert [(one.what, one.command, one.outcome) for one in seen.audit if one.command] == [
            ("ran", "say", 'done: {"level": 7}')
        ]


async def test_a_call_without_the_right_reaches_no_robot_and_is_audited() -> None:
    async with viewer() as seen:
        say = seen.service_id("/puppet/say")
        seen.rights.now = "watch"
        await seen.send(call_frame(say, 3, "json", b'{"word": "hello"}'))
        assert seen.failures() == {3: "This needs the role drive."}
        assert seen.robot.commands == []
        assert [(one.what, one.command) for one in seen.audit] == [("refused", "say")]


async def test_bad_calls_fail_with_the_reason() -> None:
    async with viewer() as seen:
        say = seen.service_id("/puppet/say")
        await seen.send(call_frame(say, 1, "json", b"[]"))
        await seen.send(call_frame(say, 2, "cdr", b"{}"))
        await seen.send(call_frame(4000, 3, "json", b"{}"))
        failures = seen.failures()
        assert failures[1].startswith("expected a JSON object with the arguments")
        assert failures[2] == "expected the encoding 'json', found 'cdr'"
        assert failures[3] == "there is no service 4000"
        assert seen.client.faults == 1
        assert seen.robot.commands == []


async def test_a_watcher_may_stop() -> None:
    async with viewer("watch") as seen:
        controller = seen.services["puppet"].controls.controller
        await seen.call("/puppet/STOP", 8, {})
        assert controller.lease.state.latched_by == "viewer"
        await seen.clock.advance(2)
        assert seen.replies()[8]["latched"] == "viewer"


async def test_no_limit_refuses_stop() -> None:
    async with viewer("watch") as seen:
        stop = call_frame(seen.service_id("/puppet/STOP"), 1, "json", b"{}")
        for _ in range(MESSAGES_PER_S):
            seen.line.say({"op": "unsubscribe", "subscriptionIds": []})
        seen.line.receiver.put_nowait({"type": "websocket.receive", "bytes": stop})
        await settle()
        assert seen.line.closed is not None
        assert seen.services["puppet"].controls.controller.lease.state.latched_by == "viewer"

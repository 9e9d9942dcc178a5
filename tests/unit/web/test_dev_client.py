"""One dev page's line: bounded both ways, in order, and nobody else's trouble."""

import asyncio
import base64
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.unit.web.test_client import FakeLine
from urc.model.driver import Command, FramingSpec, TransportSpec
from urc.model.exchange import Hold
from urc.model.profile import Profile, Setting
from urc.motion.lease import Operator as Screen
from urc.problems import Problem, UrcError
from urc.runtime.hub import Traffic
from urc.runtime.topic_check import TopicUse
from urc.testing.clock import FakeClock, settle
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.profile import text
from urc.transports.ros.topic_list import TopicList, TopicRow
from urc.web.dev.client import BAD_MESSAGES, MESSAGES_PER_S, ROWS_KEPT, TOPICS_S, Backlog, DevClient
from urc.web.dev.rows import TrafficRow
from urc.web.dev.topics import encode_topic_table
from urc.web.dev.watch import CheckedProfile, ProfileWatch
from urc.web.feed.client_socket import FixedRights, SocketPeer
from urc.web.feed.topic_watch import TopicRates
from urc.web.fleet.robots import Robot, RobotService

pytestmark = pytest.mark.anyio


class Scene:
    """A dev page on a fake robot."""

    def __init__(self, service: RobotService, robot: FakeRobot, clock: FakeClock) -> None:
        self.service = service
        self.robot = robot
        self.clock = clock
        self.line = FakeLine()
        self.watch = ProfileWatch(
            service, lambda profile: Robot(profile, {}, robot.open), service.replace
        )
        self.client = DevClient(self.line, self.watch, self.line)
        self.task = asyncio.create_task(self.client.serve())

    def goes(self, data: bytes, direction: str = "received") -> None:
        """Let bytes go over the robot's line."""
        self.robot.hub.saw(Traffic(self.clock.now(), "wire", direction, data))  # type: ignore[arg-type]

    async def rows(self) -> list[dict[str, object]]:
        """Return the rows that were sent so far, with their bytes."""
        for _ in range(20):
            await self.clock.advance(0.06)
        sent = [row for message in self.line.of_type("rows") for row in message["rows"]]
        return [{**row, "data": base64.b64decode(row.get("data", ""))} for row in sent]


@asynccontextmanager
async def scene(profile: Profile | None = None, secret: str = "") -> AsyncIterator[Scene]:
    """Serve one dev page; it and the service are gone after the test."""
    clock = FakeClock()
    robot = FakeRobot(profile or dashboard_profile(), clock)
    service = RobotService(Robot(robot.profile, {"password": secret}, robot.open), clock=clock)
    running = asyncio.create_task(service.run())
    made = Scene(service, robot, clock)
    await settle()
    try:
        yield made
    finally:
        made.line.leave()
        made.line.free.set()
        await settle()
        running.cancel()
        made.task.cancel()
        await settle()


async def until(is_true: Callable[[], bool]) -> None:
    """Wait for a thread of the server's."""
    loop = asyncio.get_running_loop()
    end_s = loop.time() + 10
    while not is_true():
        assert loop.time() < end_s, "it did not come true"
        await asyncio.sleep(0.01)


async def test_traffic_and_notes_come_in_their_order() -> None:
    """With the line, the direction, and the bytes."""
    async with scene() as it:
        it.goes(b"ask\n", "sent")
        it.robot.log("no-match: no declaration matches 'x'")
        it.goes(b"42\n")
        rows = await it.rows()
        assert [(row["kind"], row["line"], row["data"]) for row in rows] == [
            ("sent", "wire", b"ask\n"),
            ("note", "wire", b""),
            ("received", "wire", b"42\n"),
        ]
        assert [row["n"] for row in rows] == [0, 1, 2]


async def test_traffic_is_only_recorded_while_a_page_is_open() -> None:
    """It costs nothing otherwise."""
    async with scene() as it:
        assert it.robot.hub.traffic_watchers == 1
        it.line.leave()
        await settle()
        assert it.robot.hub.traffic_watchers == 0


async def test_a_page_that_takes_nothing_loses_the_oldest() -> None:
    """It is told by the gap in the numbers how many; the robot does not notice."""
    async with scene() as it:
        it.line.free.clear()
        for number in range(ROWS_KEPT + 300):
            it.goes(b"%d\n" % number)
            if number % 100 == 0:
                await settle()
        await settle()
        it.line.free.set()
        rows = await it.rows()
        assert rows[-1]["data"] == b"%d\n" % (ROWS_KEPT + 299)
        first = next(place for place, row in enumerate(rows) if row["n"] != place)
        missing = int(str(rows[first]["n"])) - first
        assert missing == ROWS_KEPT + 300 - len(rows)
        assert missing >= 100


def test_a_backlog_is_bounded_in_bytes_as_well() -> None:
    """A thousand pictures would be too much."""
    backlog = Backlog()
    for number in range(100):
        backlog.push(TrafficRow(0, float(number), "received", "cam", data=bytes(40_000)))
    assert len(backlog) < 30
    assert backlog.first == 100 - len(backlog)
    assert backlog.pop()[-1].n == 99


async def test_a_question_is_answered_with_its_number() -> None:
    """Both kinds, off the loop."""
    async with scene() as it:
        it.line.say({"t": "try", "id": 7, "transport": "radio", "text": "x"})
        it.line.say({"t": "show", "id": 8, "command": "hop", "arguments": {}})
        await until(lambda: bool(it.line.of_type("shown")))
        assert it.line.of_type("tried")[0]["id"] == 7
        assert "no transport 'radio'" in it.line.of_type("tried")[0]["error"]
        assert it.line.of_type("shown")[0]["id"] == 8


async def test_no_real_secret_is_in_a_preview() -> None:
    """A word stands for it."""
    settings = {"password": Setting("password", "string", is_secret=True)}
    login = Command("login", "wire", text("PASS {{ settings.password }}"))
    profile = dashboard_profile(settings=settings, commands={"login": login})
    wire = TransportSpec("wire", "tcp", framing=FramingSpec(options={"tx": b"\n", "rx": b"\n"}))
    profile = profile._replace(driver=profile.driver._replace(transports={"wire": wire}))
    async with scene(profile, "hunter2") as it:
        it.line.say({"t": "show", "id": 1, "command": "login", "arguments": {}})
        await until(lambda: bool(it.line.of_type("shown")))
        (frame,) = it.line.of_type("shown")[0]["frames"]
        assert base64.b64decode(frame["data"]) == b"PASS SECRET\n"


async def test_a_page_that_talks_nonsense_is_closed() -> None:
    """A few messages are forgiven."""
    async with scene() as it:
        for _ in range(BAD_MESSAGES):
            it.line.say({"t": "boo"})
        await settle()
        assert it.line.closed == (4400, f"{BAD_MESSAGES} messages were invalid")


async def test_a_page_that_talks_too_fast_is_closed() -> None:
    """A flood of pings is one."""
    async with scene() as it:
        for number in range(MESSAGES_PER_S + 1):
            it.line.say({"t": "ping", "c": number})
        await settle()
        assert it.line.closed == (4429, f"more than {MESSAGES_PER_S} messages a second")


# -- going on with another version


def with_commands(*names: str, is_held: bool = False) -> Profile:
    """Return a profile that differs in its commands."""
    hold = Hold(repeat_s=0.05) if is_held else None
    return dashboard_profile(
        commands={name: Command(name, "wire", text(name), hold=hold) for name in names}
    )


async def test_an_open_session_ends_and_the_next_is_of_the_new_version() -> None:
    """Who visits needs not come again."""
    async with scene(with_commands("old")) as it:
        first = await it.service.live()
        other = FakeRobot(with_commands("new"), it.clock)
        it.service.replace(Robot(other.profile, {}, other.open))
        await settle()
        assert first.ended.is_set()
        assert not it.robot.is_open
        assert other.is_open
        assert list(it.service.robot.profile.driver.commands) == ["new"]
        other.hub.saw(Traffic(it.clock.now(), "wire", "received", b"hello\n"))
        assert (await it.rows())[-1]["data"] == b"hello\n"


async def test_a_latched_stop_holds_over_a_new_version() -> None:
    """Nothing moves because somebody saved a file; the screens are still known."""
    async with scene(with_commands("go", is_held=True)) as it:
        controls = it.service.controls
        operator = controls.add_page(SocketPeer(rights=FixedRights("maintain")), lambda: None)
        controls.stop("screen 1")
        await settle()
        assert it.service.is_at_rest
        other = FakeRobot(with_commands("go", "turn", is_held=True), it.clock)
        it.service.replace(Robot(other.profile, {}, other.open))
        await settle()
        assert controls.controller.lease.state.latched_by == "screen 1"
        assert controls.commands == ("go", "turn")
        assert controls.controller.drive(operator.client.id, "reset", it.clock.now()) == ""


async def test_a_version_waits_while_somebody_drives(tmp_path: Path) -> None:
    """It is good, and not yet running; it runs when the controls are free."""
    async with scene(with_commands("go", is_held=True)) as it:
        watch, controller = it.watch, it.service.controls.controller
        screen = Screen("s9", "screen 9", "maintain")
        controller.join(screen)
        assert controller.drive("s9", "take", it.clock.now()) == ""
        await settle()
        watch._next = with_commands("new")
        assert not watch._try_switch()
        controller.drive("s9", "leave", it.clock.now())
        await settle()
        assert watch._try_switch()
        await settle()
        assert list(it.service.robot.profile.driver.commands) == ["new"]
        assert (watch.state, watch.told) == ("running", "was saved and is now running")


async def test_a_version_that_cannot_be_made_changes_nothing() -> None:
    """A setting that does not fit any more, for one."""
    async with scene(with_commands("old")) as it:

        def refuse(_: Profile) -> Robot:
            raise UrcError("--set speed: 'x' is no number")

        watch = ProfileWatch(it.service, refuse, it.service.replace)
        watch._next = with_commands("new")
        assert watch._try_switch()
        assert watch.state == "broken"
        assert "'x' is no number" in watch.told
        assert list(it.service.robot.profile.driver.commands) == ["old"]


async def test_a_broken_version_is_told_in_the_terminal(caplog: pytest.LogCaptureFixture) -> None:
    """In one line with its place: nobody need have the dev page open."""
    async with scene(with_commands("old")) as it:
        problems = (Problem("unknown-key", "'sumary' is not a key", "lamp/widget.yaml", 5),)
        it.watch._judge(CheckedProfile(None, problems, ()))
        assert it.watch.state == "broken"
        assert "lamp/widget.yaml:5:1: error unknown-key" in caplog.text


async def test_topics_are_sent_only_while_the_page_shows_them() -> None:
    """Each change once, with hostile names escaped."""
    row = TopicRow("/odom", ("nav_msgs/msg/Odometry",), None, ("/<b>",), (), 3)
    listed = TopicList((row,), 100_000, 2, True, True)
    async with scene() as made:
        made.robot.hub.set_topics("wire", listed)
        await made.clock.advance(5)
        assert made.line.of_type("topics") == []
        made.line.say({"t": "topics", "shown": True})
        for _ in range(20):
            await made.clock.advance(TOPICS_S)
        (told,) = made.line.of_type("topics")
        shown = {"name": "/odom", "types": ["nav_msgs/msg/Odometry"], "publishers": ["/<b>"],
                 "subscribers": []}  # fmt: skip
        table = {"transport": "wire", "total": 100_000, "version": 2, "known": True}
        assert told == {"t": "topics", "tables": [{**table, "rows": [shown]}]}
        made.robot.hub.set_topics("wire", listed._replace(total=7))
        await made.clock.advance(2 * TOPICS_S)
        assert [one["tables"][0]["total"] for one in made.line.of_type("topics")] == [100_000, 7]
        made.line.say({"t": "topics", "shown": False})
        await made.clock.advance(2 * TOPICS_S)
        made.robot.hub.set_topics("wire", listed._replace(total=9))
        await made.clock.advance(10)
        assert len(made.line.of_type("topics")) == 2


def test_used_topics_come_first_with_their_rates() -> None:
    rates = TopicRates()
    rows = tuple(TopicRow(name, received=10 if name == "/odom" else None) for name in
                 ("/a", "/odom", "/cmd_vel"))  # fmt: skip
    rates.take("ros", TopicList((TopicRow("/odom", received=0),), 1, 2, True, True), 0.0)
    listed = TopicList(rows, 3, 2, True, True)
    rates.take("ros", listed, 4.0)
    uses = [
        TopicUse("ros", "/cmd_vel", "geometry_msgs/Twist", True, ("drive",)),
        TopicUse("ros", "/odom", "nav_msgs/Odometry", False, ("x", "y")),
    ]
    (table,) = json.loads(encode_topic_table({"ros": listed}, uses, rates))["tables"]
    assert table["rows"] == [
        {"name": "/cmd_vel", "used": ["drive"], "is_used": True},
        {"name": "/odom", "rate": 2.5, "used": ["x", "y"], "is_used": True},
        {"name": "/a"},
    ]

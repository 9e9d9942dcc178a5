"""The life of a robot's session: opened for the first client, closed after the last."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, ExitStack, asynccontextmanager
from dataclasses import replace
from functools import partial
from itertools import pairwise

import pytest

from urc.model.profile import Setting
from urc.model.values import Signal
from urc.problems import UrcError
from urc.runtime.clock import Timer
from urc.testing.clock import FakeClock, settle
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.fleet.robots import (
    LINGER_S,
    STOP_DUE_S,
    Robot,
    RobotService,
    SessionFailed,
    missing_settings,
)

pytestmark = pytest.mark.anyio


@asynccontextmanager
async def stationed(
    robot: FakeRobot, clock: FakeClock, opener: object = None, turn: asyncio.Lock | None = None
) -> AsyncIterator[RobotService]:
    """Run a service for the fake robot."""
    open_session = opener or robot.open
    service = RobotService(
        Robot(robot.profile, {"host": "127.0.0.1"}, open_session),  # type: ignore[arg-type]
        clock=clock,
        start_lock=turn,
    )
    task = asyncio.create_task(service.run())
    try:
        yield service
    finally:
        task.cancel()
        await settle()


async def test_the_session_lives_from_the_first_client_to_the_last() -> None:
    """Two clients share one session; two seconds after they have gone it is closed."""
    clock = FakeClock()
    robot = FakeRobot(dashboard_profile(), clock)
    async with stationed(robot, clock) as service:
        await settle()
        assert robot.opened == 0
        with ExitStack() as both:
            both.enter_context(service.visit())
            first = await service.live()
            both.enter_context(service.visit())
            assert await service.live() is first
            assert (robot.opened, robot.is_open) == (1, True)
        await clock.advance(1.9)
        assert robot.is_open
        await clock.advance(0.2)
        assert not robot.is_open
        assert first.ended.is_set()


async def test_sessions_that_start_together_leave_room_for_input_between_two() -> None:
    """The start of a session blocks the loop; a robot that is driven waits for one at most."""
    turn, seen = asyncio.Lock(), []
    clock = FakeClock()

    @asynccontextmanager
    async def opened(number: int) -> AsyncIterator[object]:
        seen.append(f"start {number}")
        robot = FakeRobot(dashboard_profile(), clock)
        async with robot.open() as session:
            yield session

    async def drive() -> None:
        while True:
            seen.append("input")
            await asyncio.sleep(0)

    async with AsyncExitStack() as stack:
        for number in range(3):
            robot = FakeRobot(dashboard_profile(), clock)
            service = await stack.enter_async_context(
                stationed(robot, clock, partial(opened, number), turn)
            )
            stack.enter_context(service.visit())
        driving = asyncio.create_task(drive())
        await settle()
        driving.cancel()
    starts = [at for at, what in enumerate(seen) if what != "input"]
    assert len(starts) == 3
    assert all("input" in seen[one:other] for one, other in pairwise(starts))


async def test_the_session_stays_until_the_robot_has_received_the_stop() -> None:
    """STOP is pressed without a page, and the robot can be reached only later."""
    clock = FakeClock()
    robot = FakeRobot(dashboard_profile(), clock)
    async with stationed(robot, clock) as service:
        controller = service.controls.controller
        controller._unconfirmed = {"halt"}
        with service.visit():
            await service.live()
        await clock.advance(60.0)
        assert robot.is_open
        controller.given("halt")
        await clock.advance(0.2)
        assert not robot.is_open


async def test_the_session_does_not_stay_for_ever_for_a_robot_that_is_off() -> None:
    clock = FakeClock()
    robot = FakeRobot(dashboard_profile(), clock)
    async with stationed(robot, clock) as service:
        service.controls.controller._unconfirmed = {"halt"}
        with service.visit():
            await service.live()
        await clock.advance(LINGER_S + STOP_DUE_S - 1.0)
        assert robot.is_open
        await clock.advance(2.0)
        assert not robot.is_open


async def test_a_reload_keeps_the_session() -> None:
    """A client that is back within the time finds the same session."""
    clock = FakeClock()
    robot = FakeRobot(dashboard_profile(), clock)
    async with stationed(robot, clock) as service:
        with service.visit():
            first = await service.live()
        await clock.advance(1.0)
        with service.visit():
            await clock.advance(10.0)
            assert await service.live() is first
            assert robot.is_open
        assert robot.opened == 1


async def test_a_client_that_comes_too_late_gets_a_new_session() -> None:
    """After the session was closed, the next client opens another."""
    clock = FakeClock()
    robot = FakeRobot(dashboard_profile(), clock)
    async with stationed(robot, clock) as service:
        with service.visit():
            first = await service.live()
        await clock.advance(3.0)
        with service.visit():
            assert await service.live() is not first
        assert robot.opened == 2


async def test_a_client_that_comes_while_a_session_closes_gets_the_next_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In whichever turn of the loop it comes: each waiting client is told of the new session."""

    async def serve(session: object) -> None:
        try:
            await asyncio.Event().wait()
        finally:
            for _ in range(10):  # as the tasks of a robot that moves take some turns to end
                await asyncio.sleep(0)

    opened = set()
    for turns in range(0, 100, 3):
        clock = FakeClock()
        robot = FakeRobot(dashboard_profile(), clock)
        async with stationed(robot, clock) as service:
            monkeypatch.setattr(service.controls, "serve", serve)
            with service.visit():
                await service.live()
            advancing = asyncio.create_task(clock.advance(LINGER_S + 0.1))
            for _ in range(turns):
                await asyncio.sleep(0)
            with service.visit():
                coming = asyncio.create_task(service.live())
                await advancing
                await settle()
                assert coming.done(), f"after {turns} turns, it waits for a session in vain"
                opened.add(robot.opened)
    assert opened == {1, 2}, "it never came before the end, or never after it"


async def test_a_session_that_cannot_be_opened_is_told_and_tried_again() -> None:
    """The waiting client learns why in one line; the supervisor goes on."""
    clock = FakeClock()
    robot = FakeRobot(dashboard_profile(), clock)
    faults: list[Exception] = [UrcError("no such host"), ValueError("a bug")]

    @asynccontextmanager
    async def opener() -> AsyncIterator[FakeRobot]:
        if faults:
            raise faults.pop(0)
        async with robot.open() as session:
            yield session

    async with stationed(robot, clock, opener) as service:
        with service.visit():
            with pytest.raises(SessionFailed) as caught:
                await service.live()
            assert str(caught.value) == "no such host"
            waiting = asyncio.ensure_future(service.live())
            await settle()
            await clock.advance(1.1)
            with pytest.raises(SessionFailed) as caught:
                await waiting
            assert "failed" in str(caught.value)
            assert "a bug" not in str(caught.value)
            waiting = asyncio.ensure_future(service.live())
            await settle()
            await clock.advance(1.1)
            assert (await waiting).session is robot


def test_a_robot_is_not_ready_while_a_setting_is_undefined() -> None:
    """Nothing and an empty text are both "not set"; False, 0 and an empty default are values."""
    settings = {
        name: Setting(name, "string", default=default)
        for name, default in {"a": None, "b": "", "c": "x", "d": False, "e": 0}.items()
    }
    profile = dashboard_profile(settings=settings)
    for values in ({}, {"a": "", "b": ""}):
        robot = Robot(profile, values, FakeRobot(profile).open)
        assert [setting.name for setting in missing_settings(robot)] == ["a"]
    robot = Robot(profile, {"a": "1"}, FakeRobot(profile).open)
    assert missing_settings(robot) == ()


async def test_a_robot_that_is_held_off_is_let_go_of_and_comes_back() -> None:
    """Whoever looks on waits for the next session; without anybody nothing is opened."""
    clock = FakeClock()
    robot = FakeRobot(dashboard_profile(), clock)
    async with stationed(robot, clock) as service:
        with service.visit():
            first = await service.live()
            release = asyncio.Event()
            holding = asyncio.create_task(_hold(service, release))
            await clock.advance(0.1)
            assert (robot.is_open, first.ended.is_set()) == (False, True)
            with service.visit():
                await clock.advance(0.1)
                assert not robot.is_open
            release.set()
            await holding
            assert await service.live() is not first
            assert robot.opened == 2
        await clock.advance(2.1)
        async with service.held_off():
            assert not service.is_open
        await settle()
        assert robot.opened == 2


async def _hold(service: RobotService, release: asyncio.Event) -> None:
    async with service.held_off():
        await release.wait()


class HastyClock(FakeClock):
    """A clock whose alarms ring a little before their time, as those of some event loops do."""

    def call_at(self, when_s: float, callback: Callable[[], object]) -> Timer:
        """Ring half a millisecond early."""
        return super().call_at(when_s - 0.0005, callback)


async def test_an_alarm_that_rings_early_ends_the_session_all_the_same() -> None:
    """Else a robot would stay connected for ever after Back."""
    clock = HastyClock()
    robot = FakeRobot(dashboard_profile(), clock)
    async with stationed(robot, clock) as service:
        with service.visit():
            await service.live()
        await clock.advance(2.1)
        assert not robot.is_open


async def test_a_monitored_robot_is_connected_with_no_page_open() -> None:
    """Its alarms are judged; a page that comes and goes changes nothing."""
    clock = FakeClock()
    robot = FakeRobot(dashboard_profile(), clock)
    async with stationed(robot, clock) as service:
        assert robot.opened == 0
        monitored = replace(service.robot, is_monitored=True)
        service.replace(monitored)
        await clock.advance(0.1)
        assert robot.is_open
        robot.set_reading("battery", 15, alarm="low")
        assert [one.state for one in service.alarms.list.records.values()] == ["unacknowledged"]
        with service.visit():
            await service.live()
        await clock.advance(60)
        assert (robot.opened, robot.is_open) == (1, True)
        release = asyncio.Event()
        holding = asyncio.create_task(_hold(service, release))
        await clock.advance(0.1)
        assert not robot.is_open, "a test of the settings still gets the robot for itself"
        release.set()
        await holding
        await clock.advance(0.1)
        assert robot.is_open
        service.replace(replace(monitored, is_monitored=False))
        await clock.advance(5)
        assert not service.is_open
        record = service.alarms.list.records["battery"]
        assert (record.state, record.is_known) == ("unacknowledged", False)


async def test_a_robot_without_alarms_or_settings_is_not_monitored() -> None:
    """A connection for nothing would keep other programs from the robot."""
    clock = FakeClock()
    silent = {"speed": Signal("speed", stale_after_s=3.0)}
    for profile in (
        dashboard_profile(signals=silent),
        dashboard_profile(settings={"key": Setting("key", "string")}),
    ):
        robot = FakeRobot(profile, clock)
        async with stationed(robot, clock) as service:
            service.replace(replace(service.robot, is_monitored=True))
            await clock.advance(5)
            assert (robot.opened, robot.is_open) == (0, False)

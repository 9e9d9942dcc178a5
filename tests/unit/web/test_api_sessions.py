"""Programs that drive over HTTP: their sessions begin, are kept, and end by themselves."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager

import pytest

from tests.unit.runtime.desks import DRIVER
from urc.access.directory import Identity
from urc.model.role import Role
from urc.testing.clock import FakeClock, settle
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.movers import FakeMotionBackend
from urc.web.api.sessions import IDLE_S, MOST_SESSIONS, ProgramSession, ProgramSessions
from urc.web.api.wire import LeaseAsked, MotionAsked
from urc.web.feed.client_socket import SocketPeer
from urc.web.fleet.robots import Robot, RobotService
from urc.web.serve.replies import ApiError

pytestmark = pytest.mark.anyio

MINE = Identity("p1", "s1", "night patrol", "program", "token")
THEIRS = Identity("p2", "s2", "day patrol", "program", "token")


class Rights:
    """Rights that a test takes away."""

    def __init__(self) -> None:
        self.now: Role | None = "drive"

    def role(self) -> Role | None:
        return self.now

    def may_give(self, command: str) -> bool:
        return True

    def limit(self) -> str:
        return ""


class Scene:
    """A robot that is connected, and the sessions of programs."""

    def __init__(self, clock: FakeClock, robot: FakeRobot, service: RobotService) -> None:
        self.clock = clock
        self.robot = robot
        self.service = service
        self.rights = Rights()
        self.followers: set[Callable[[], None]] = set()
        self.sessions = ProgramSessions(self.followed)

    @contextmanager
    def followed(self, recheck: Callable[[], None]) -> Iterator[None]:
        self.followers.add(recheck)
        try:
            yield
        finally:
            self.followers.discard(recheck)

    @property
    def written(self) -> list[str]:
        assert isinstance(self.robot.backend, FakeMotionBackend)
        return self.robot.backend.texts

    def peer(self, identity: Identity = MINE) -> SocketPeer:
        return SocketPeer("10.0.0.7", identity.principal, True, identity, rights=self.rights)

    async def begun(self, identity: Identity = MINE) -> ProgramSession:
        opening = asyncio.create_task(self.sessions.begin(self.service, self.peer(identity)))
        await settle()
        return await opening

    async def driving(self) -> ProgramSession:
        """Take the controls and move."""
        session = await self.begun()
        lease = session.ask(LeaseAsked("take"))
        assert lease.drives
        assert lease.beat is not None
        session.move(tick(session, 1, lease.beat))
        return session


def tick(session: ProgramSession, number: int, beat: int, **more: object) -> MotionAsked:
    return MotionAsked(
        session.secret,
        "drive",
        session.epoch,
        number,
        beat,
        {"speed": 1.0},
        **more,  # type: ignore[arg-type]
    )


@asynccontextmanager
async def connected() -> AsyncIterator[Scene]:
    clock = FakeClock()
    profile = dashboard_profile()
    robot = FakeRobot(profile._replace(driver=DRIVER), clock)
    service = RobotService(Robot(robot.profile, {}, robot.open), clock=clock)
    task = asyncio.create_task(service.run())
    try:
        yield Scene(clock, robot, service)
    finally:
        task.cancel()
        await settle()


async def test_a_program_drives_and_lets_go() -> None:
    async with connected() as scene:
        session = await scene.driving()
        assert session.operator.client.name == "night patrol"
        moved = len(scene.written)
        assert moved
        session.move(tick(session, 2, 0, release=True))
        assert len(scene.written) > moved


async def test_a_session_ends_without_requests() -> None:
    """Its controls are free, its operator is gone, and the robot is disconnected."""
    async with connected() as scene:
        session = await scene.driving()
        await scene.clock.advance(IDLE_S - 0.1)
        scene.sessions.find(session.secret, scene.service, MINE)
        await scene.clock.advance(IDLE_S - 0.1)
        assert scene.service.controls.operators == (session.operator,)
        await scene.clock.advance(0.2)
        assert scene.service.controls.operators == ()
        assert scene.service.controls.controller.lease.state.holder is None
        with pytest.raises(ApiError) as refused:
            scene.sessions.find(session.secret, scene.service, MINE)
        assert (refused.value.status, refused.value.code) == (404, "no-session")
        await scene.clock.advance(3)
        assert not scene.robot.is_open
        assert scene.followers == set()


@pytest.mark.parametrize("role", [None, "watch"])
async def test_a_session_ends_with_its_right(role: Role | None) -> None:
    """Before the callback returns, the robot was told to stop."""
    async with connected() as scene:
        await scene.driving()
        written = len(scene.written)
        scene.rights.now = role
        for recheck in tuple(scene.followers):
            recheck()
        assert len(scene.written) > written
        assert scene.service.controls.operators == ()
        assert scene.service.controls.controller.lease.state.holder is None


async def test_a_session_belongs_to_one_visitor() -> None:
    """A secret that another visitor has learnt is of no use to it."""
    async with connected() as scene:
        session = await scene.begun()
        for secret, who in ((session.secret, THEIRS), (session.secret[:-1], MINE), ("", MINE)):
            with pytest.raises(ApiError):
                scene.sessions.find(secret, scene.service, who)
        assert scene.sessions.find(session.secret, scene.service, MINE) is session


async def test_a_visitor_has_few_sessions() -> None:
    """Others still get theirs, and one that ends makes room."""
    async with connected() as scene:
        mine = [await scene.begun() for _ in range(MOST_SESSIONS)]
        with pytest.raises(ApiError) as refused:
            await scene.begun()
        assert refused.value.status == 429
        await scene.begun(THEIRS)
        scene.sessions.end(mine[0])
        await scene.begun()


async def test_a_refused_request_about_the_controls_is_told() -> None:
    async with connected() as scene:
        await scene.driving()
        other = await scene.begun(THEIRS)
        with pytest.raises(ApiError, match="night patrol has the controls"):
            other.ask(LeaseAsked("take"))
        asked = other.ask(LeaseAsked("ask"))
        assert (asked.drives, asked.holder, asked.asker) == (False, "night patrol", "day patrol")


async def test_an_input_that_is_late_or_old_is_refused() -> None:
    """With the reason, and without moving."""
    async with connected() as scene:
        session = await scene.driving()
        beat = session.beat
        assert beat is not None
        await scene.clock.advance(0.02)
        with pytest.raises(ApiError, match="not newer"):
            session.move(tick(session, 1, beat))
        await scene.clock.advance(1.0)
        with pytest.raises(ApiError, match=r"ms late|let go, then"):  # the stop may be first
            session.move(tick(session, 5, beat))
        old = MotionAsked(session.secret, "drive", session.epoch - 1, 9, beat, {"speed": 1.0})
        with pytest.raises(ApiError, match="changed hands"):
            session.move(old)
        with pytest.raises(ApiError, match="is not a held command"):
            session.move(MotionAsked(session.secret, "dance", session.epoch, 9, beat))


async def test_a_stop_is_told_with_the_next_answer() -> None:
    async with connected() as scene:
        session = await scene.driving()
        scene.service.controls.stop("Ann")
        with pytest.raises(ApiError, match="Stopped by Ann"):
            session.move(tick(session, 2, 1))
        state = session.ask(LeaseAsked("reset"))
        assert (state.latched, state.drives, state.stops) == ("", False, 1)


async def test_the_end_of_the_robots_session_ends_those_of_programs() -> None:
    async with connected() as scene:
        session = await scene.begun()
        holding = asyncio.create_task(hold_off(scene.service))
        await scene.clock.advance(0.1)
        with pytest.raises(ApiError) as refused:
            scene.sessions.find(session.secret, scene.service, MINE)
        assert refused.value.code == "no-session"
        assert scene.service.controls.operators == ()
        holding.cancel()


async def hold_off(service: RobotService) -> None:
    async with service.held_off():
        await asyncio.Event().wait()


async def test_the_server_ends_all_sessions() -> None:
    async with connected() as scene:
        await scene.driving()
        await scene.begun(THEIRS)
        scene.sessions.close()
        assert scene.service.controls.operators == ()

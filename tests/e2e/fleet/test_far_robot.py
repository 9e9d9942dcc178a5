"""A robot of another site is seen, driven and stopped from here, with its own site in charge."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from pathlib import Path

import pytest

import urc.client
from tests.e2e.dashboards import until
from tests.e2e.fleet.places import Place, keys_of, message, place, write_rules
from tests.e2e.transports.certificates import Authority
from urc import __version__
from urc.access.grants import Grant
from urc.client.remote import RemoteRobot
from urc.problems import UrcError
from urc.runtime.open_profile import open_document
from urc.shipped import shipped
from urc.testing.dashboard import FakeRobot
from urc.testing.fleet_bus import FakeFleetNetwork
from urc.testing.movers import FakeMotionBackend

pytestmark = pytest.mark.anyio


class Fleet:
    """The sites bern, which has the robot, and zug, which has a screen."""

    def __init__(
        self,
        authority: Authority,
        network: FakeFleetNetwork,
        bern: Place,
        zug: Place,
        robot: FakeRobot,
    ) -> None:
        self.authority = authority
        self.network = network
        self.bern = bern
        self.zug = zug
        self.robot = robot
        self.name = f"{robot.profile.name}@bern"

    def client(self) -> AbstractAsyncContextManager[RemoteRobot]:
        """Return a program's connection to the robot, through zug."""
        return urc.client.open(self.zug.url, self.name, token=self.zug.access.key)

    async def listed(self) -> None:
        """Wait until zug knows the robot."""
        watch = self.zug.network.watch
        await self.zug.ask("/api/v1/robots")  # a look at the list requests it
        await until(lambda: "bern" in watch.sites)


@asynccontextmanager
async def open_fleet(
    folder: Path,
    rules: str = "",
    versions: tuple[str, str] = (__version__, __version__),
) -> AsyncIterator[Fleet]:
    """Run both sites; bern has these rules for visitors, and the first version."""
    authority, network = Authority(folder), FakeFleetNetwork()
    sites = [keys_of(authority, one, folder) for one in ("bern", "zug")]
    robot = FakeRobot(open_document(shipped("robots") / "turtlebot4.yaml"))
    async with AsyncExitStack() as stack:
        bern = await stack.enter_async_context(
            place(network, sites[0], robot, rules=rules, version=versions[0])
        )
        zug = await stack.enter_async_context(place(network, sites[1], version=versions[1]))
        yield Fleet(authority, network, bern, zug, robot)


@pytest.fixture
async def fleet(tmp_path: Path) -> AsyncIterator[Fleet]:
    """Run both sites."""
    async with open_fleet(tmp_path) as made:
        yield made


async def test_the_list_has_the_robots_of_other_sites(fleet: Fleet) -> None:
    """Their names end with the site, which is also a tag."""
    await fleet.listed()
    _, found, _ = await fleet.zug.ask("/api/v1/robots")
    assert [(one["name"], one["tags"][0]) for one in found["robots"]] == [(fleet.name, "bern")]


async def test_the_page_is_made_here_and_its_socket_leads_there(fleet: Fleet) -> None:
    """The page has this server's policy, and the address of the robot at its site."""
    status, page, headers = await fleet.zug.ask(f"/robots/{fleet.name}/")
    assert status == 200
    assert b"/ws?robot=turtlebot4%40bern" in page
    assert b"TurtleBot 4" in page
    assert "default-src 'none'" in headers["content-security-policy"]


async def test_readings_arrive_through_the_fleet(fleet: Fleet) -> None:
    """A program follows the robot as if it were here."""
    async with fleet.client() as robot:
        await until(lambda: fleet.robot.is_open)
        fleet.robot.set_reading("speed", 0.5)
        sample = await robot.wait_for("speed", timeout=10)
        assert sample.value == 0.5


async def hold(robot: RemoteRobot, seconds: float) -> None:
    """Hold the robot's stick."""
    async with robot.drive("drive") as stick:
        await stick.hold(seconds, speed=0.1)


async def test_the_robot_is_driven_and_stops_on_release(fleet: Fleet) -> None:
    """The lease, the limits and the stop belong to the robot's site."""
    backend = fleet.robot.backend
    assert isinstance(backend, FakeMotionBackend)
    async with fleet.client() as robot:
        await hold(robot, 0.5)
        await until(lambda: backend.texts[-1:] == ["drive stop"])
        assert backend.texts.count("drive speed=0.1 turn=0") > 3


async def test_a_cut_network_stops_the_robot_and_healing_moves_nothing(fleet: Fleet) -> None:
    """The site alone decides: without ticks, the lease of the motion ends."""
    backend = fleet.robot.backend
    assert isinstance(backend, FakeMotionBackend)
    async with fleet.client() as robot:
        driving = asyncio.create_task(hold(robot, 30))
        await until(lambda: len(backend.written) > 3)
        fleet.network.cut("bern", "zug")
        await until(lambda: backend.texts[-1] == "drive stop")
        count = len(backend.written)
        fleet.network.heal()
        await asyncio.sleep(0.5)
        assert set(backend.texts[count:]) <= {"drive stop"}
        with pytest.raises(UrcError):
            await driving


async def test_stop_latches_at_the_robots_site(fleet: Fleet) -> None:
    """The audit there names the person and the site."""
    status, said, _ = await fleet.zug.ask(f"/api/v1/robots/{fleet.name}/stop", {})
    assert status == 200, said
    _, state, _ = await fleet.bern.ask("/api/v1/robots/turtlebot4/controls")
    assert state["latched"].endswith("(zug)")


async def test_a_stranger_may_press_stop_and_nothing_else(fleet: Fleet) -> None:
    """As beside the robot, STOP needs no sign-in."""
    path = f"/api/v1/robots/{fleet.name}"
    assert (await fleet.zug.ask(f"{path}/controls", key=""))[0] == 401
    assert (await fleet.zug.ask(path, key=""))[0] == 401
    origin = {"origin": fleet.zug.url.rstrip("/")}
    assert (await fleet.zug.ask(f"{path}/stop", {}, key="", more=origin))[0] == 200


async def test_a_site_that_cannot_be_reached_is_named(fleet: Fleet) -> None:
    """STOP is told to have failed, and the list says why the robot is lost."""
    await fleet.listed()
    fleet.network.cut("bern", "zug")
    status, said, _ = await fleet.zug.ask(f"/api/v1/robots/{fleet.name}/stop", {})
    assert (status, said["message"]) == (502, "the site bern cannot be reached")
    _, found, _ = await fleet.zug.ask("/api/v1/robots")
    assert [(one["state"], one["detail"]) for one in found["robots"]] == [
        ("lost", "the site bern cannot be reached")
    ]


async def test_the_site_grants_less_than_the_fleet_proposes(tmp_path: Path) -> None:
    """Bern lets visitors watch; a command from zug is refused there."""
    async with open_fleet(tmp_path, rules="otherwise: watch") as fleet:
        status, said, _ = await fleet.zug.ask(f"/api/v1/robots/{fleet.name}/commands/dock", {})
        assert (status, said["code"], said["message"]) == (
            403,
            "forbidden",
            "no other rule applies, so the site bern lets this computer (zug) only watch",
        )
        assert not fleet.robot.commands
        _, found, _ = await fleet.zug.ask(f"/api/v1/robots/{fleet.name}")
        assert found["robot"]["role"] == "watch"


async def test_a_token_for_some_commands_only_watches_other_sites(fleet: Fleet) -> None:
    """Its limit is known at its own site alone, so the assertion proposes less."""
    store = fleet.zug.access.control.store
    assert store is not None
    now = fleet.zug.access.control.now()
    program = store.add("program", "Patrol", [Grant("drive")], now=now, commands=("undock",))
    _, token = store.open_sign_in(program.id, "token", now=now)
    fleet.zug.access.control.load()
    path = f"/api/v1/robots/{fleet.name}"
    assert (await fleet.zug.ask(path, key=token))[1]["robot"]["role"] == "watch"
    for command in ("dock", "undock"):
        assert (await fleet.zug.ask(f"{path}/commands/{command}", {}, key=token))[0] == 403
    assert not fleet.robot.commands


async def test_a_site_may_refuse_all_visitors(tmp_path: Path) -> None:
    """The reason reaches the visitor in one line; STOP still works."""
    async with open_fleet(tmp_path, rules="otherwise: none") as fleet:
        path = f"/api/v1/robots/{fleet.name}"
        status, said, _ = await fleet.zug.ask(path)
        assert (status, said["message"]) == (
            403,
            "no other rule applies, so the site bern refuses this computer (zug)",
        )
        assert (await fleet.zug.ask(f"{path}/stop", {}))[0] == 200


async def test_changed_rules_stop_the_robot_and_name_the_rule(tmp_path: Path) -> None:
    """The driver becomes a watcher, and learns why; nothing moves after the next change."""
    async with open_fleet(tmp_path, rules="otherwise: drive") as fleet:
        backend = fleet.robot.backend
        assert isinstance(backend, FakeMotionBackend)
        async with fleet.client() as robot:
            driving = asyncio.create_task(hold(robot, 30))
            await until(lambda: len(backend.written) > 3)
            rule = "{ name: visits, role: watch, sites: [zug] }"
            write_rules(tmp_path / "bern", f"rules: [{rule}]\notherwise: drive")
            began_s = asyncio.get_running_loop().time()
            await until(lambda: backend.texts[-1] == "drive stop")
            assert asyncio.get_running_loop().time() - began_s < 1.0
            count = len(backend.written)
            with pytest.raises(UrcError, match="the rule “visits” of the site bern"):
                await driving
            write_rules(tmp_path / "bern", "otherwise: drive")
            await until(lambda: fleet.bern.network.rules.rules.otherwise == "drive")
            await asyncio.sleep(0.5)
            assert set(backend.texts[count:]) <= {"drive stop"}


async def test_a_page_learns_which_rule_refuses_it(tmp_path: Path) -> None:
    """Pages cannot read a refused handshake, so the socket is closed with the reason."""
    async with open_fleet(tmp_path, rules="otherwise: none") as fleet:
        async with fleet.zug.socket(f"/ws?robot={fleet.name}") as line:
            said = await message(line, "error")
        assert (said["code"], said["message"]) == (
            "refused",
            "no other rule applies, so the site bern refuses this computer (zug)",
        )


async def test_a_foreign_certificate_and_a_forged_name_get_nothing(tmp_path: Path) -> None:
    """TLS proves the site; the name on the network is a claim."""
    (tmp_path / "other").mkdir()
    foreign = Authority(tmp_path / "other")
    async with open_fleet(tmp_path) as fleet, AsyncExitStack() as stack:
        mill = await stack.enter_async_context(
            place(fleet.network, keys_of(foreign, "mill", tmp_path))
        )
        status, said, _ = await mill.ask(f"/api/v1/robots/{fleet.name}")
        assert status == 502
        assert said["message"].startswith("no secure connection to the site bern")
        forged = await stack.enter_async_context(
            place(fleet.network, keys_of(fleet.authority, "thun", tmp_path), claims="chur")
        )
        status, said, _ = await forged.ask(f"/api/v1/robots/{fleet.name}")
        assert status == 502
        assert not fleet.robot.opened


@pytest.mark.parametrize("versions", [("0.3.0", "0.1.0"), ("0.1.9", "0.3.0"), ("1.0", "0.9.0")])
async def test_versions_too_far_apart_are_refused_and_stop_is_not(
    tmp_path: Path, versions: tuple[str, str]
) -> None:
    """One line says which site to update; the menu has it too."""
    async with open_fleet(tmp_path, versions=versions) as fleet:
        path, older = f"/api/v1/robots/{fleet.name}", "zug" if versions[0] > versions[1] else "bern"
        for _ in range(2):  # the first answer may come from bern, later ones come from zug
            status, said, _ = await fleet.zug.ask(path)
            assert status in (403, 502)
            assert said["message"].endswith(f"; update URC at the site {older}")
            await fleet.listed()
        assert not fleet.robot.opened
        _, found, _ = await fleet.zug.ask("/api/v1/robots")
        assert found["robots"][0]["state"] == "lost"
        assert found["sites"] == [
            {
                "name": "bern",
                "version": versions[0],
                "present": True,
                "fault": found["robots"][0]["detail"],
            }
        ]
        assert (await fleet.zug.ask(f"/robots/{fleet.name}/"))[0] == 502
        assert (await fleet.zug.ask(f"{path}/stop", {}))[0] == 200


async def test_one_version_apart_works(tmp_path: Path) -> None:
    """A fleet is updated site by site."""
    async with open_fleet(tmp_path, versions=("0.2.0", "0.1.0")) as fleet:
        await fleet.listed()
        status, _, _ = await fleet.zug.ask(f"/api/v1/robots/{fleet.name}")
        assert status == 200
        _, found, _ = await fleet.zug.ask("/api/v1/robots")
        assert [(one["version"], one["fault"]) for one in found["sites"]] == [("0.2.0", "")]


async def test_a_hello_names_the_session_of_the_site(fleet: Fleet) -> None:
    """The page's first message comes from the robot's server."""
    async with fleet.zug.socket(f"/ws?robot={fleet.name}") as line:
        assert (await message(line, "hello"))["robot"]

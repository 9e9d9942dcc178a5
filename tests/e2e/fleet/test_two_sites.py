"""Two servers in processes of their own, with nothing in common but the network: Zenoh over TLS."""

import asyncio
import json
import signal
from collections.abc import AsyncIterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.command_line import run
from tests.e2e.dashboards import until
from tests.e2e.fleet.two_sites import FAST, ROBOT, SLOW, WAIT_S, Site, TwoSites, reaches
from urc import __version__
from urc.client.remote import RemoteRobot
from urc.client.stick import MotionEnded
from urc.problems import UrcError

pytestmark = pytest.mark.anyio


@pytest.fixture
async def sites(tmp_path: Path) -> AsyncIterator[TwoSites]:
    """Run both servers."""
    made = await asyncio.to_thread(TwoSites, tmp_path)
    try:
        await asyncio.to_thread(made.start)
        yield made
    finally:
        await asyncio.to_thread(made.kill)


async def hold(robot: RemoteRobot, seconds: float) -> None:
    """Hold the robot's stick, as soon as the robot sends its speed."""
    await robot.wait_for("speed", timeout=WAIT_S)
    async with robot.drive("drive") as stick:
        await stick.hold(seconds, speed=0.2)


async def driven(robot: RemoteRobot) -> None:
    """Drive until the robot has moved; a busy machine makes the input late, which ends a push."""
    async with asyncio.timeout(WAIT_S):
        while True:
            driving = asyncio.create_task(hold(robot, 2.0))
            moving = asyncio.create_task(reaches(robot, least=FAST))
            with suppress(MotionEnded):
                await driving
                await moving
                return
            moving.cancel()


async def test_a_robot_is_driven_from_another_site(sites: TwoSites) -> None:
    """It moves while the stick is held, stands after the release, and STOP latches."""
    robot = await sites.far()
    try:
        await driven(robot)
        await reaches(robot, most=SLOW)
        async with asyncio.timeout(WAIT_S):
            while await asyncio.to_thread(shown, sites.zug) != [("bern", __version__, True)]:
                pass  # the list has not arrived yet
        assert await robot.stop()
        async with sites.bern.open(ROBOT) as beside:
            await until(lambda: "(zug)" in beside.latched_by)
    finally:
        await sites.leave()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
async def test_a_lost_screen_stops_the_robot(sites: TwoSites, number: signal.Signals) -> None:
    """A killed and a frozen server end the motion by the lease of the robot's own site."""
    robot = await sites.far()
    async with sites.bern.open(ROBOT) as beside:
        driving = asyncio.create_task(hold(robot, 30.0))
        await reaches(beside, least=FAST)
        assert sites.zug.process is not None
        sites.zug.signal(number)
        await reaches(beside, most=SLOW)
        if number == signal.SIGSTOP:
            sites.zug.signal(signal.SIGCONT)
            await asyncio.sleep(2.0)
            sample = beside.latest("speed")
            assert sample is not None
            assert abs(float(str(sample.value))) <= SLOW
        driving.cancel()
        with pytest.raises((UrcError, asyncio.CancelledError)):
            await driving


async def test_a_revoked_site_is_refused_at_once(sites: TwoSites) -> None:
    """Its connections end, and it learns the reason in one line."""
    robot = await sites.far()
    async with sites.bern.open(ROBOT) as beside:
        driving = asyncio.create_task(hold(robot, 30.0))
        await reaches(beside, least=FAST)
        await asyncio.to_thread(sites.bern.command, "fleet", "revoke", "zug")
        with pytest.raises(UrcError):
            await driving
        await reaches(beside, most=SLOW)
    status, said = await asyncio.to_thread(sites.zug.ask, f"/api/v1/robots/{ROBOT}@bern")
    assert (status, said.get("message", said)) == (
        502,
        "the site bern refuses the connection: the certificate of site zug is revoked",
    )


async def test_changed_rules_end_a_visit_and_both_sites_record_it(sites: TwoSites) -> None:
    """The robot stops within a second, and both audit logs have the same identifier."""
    robot = await sites.far()
    file = sites.bern.data / "fleet" / "rules.yaml"
    head = "urc: 1\nkind: site-rules\n"
    async with sites.bern.open(ROBOT) as beside:
        driving = asyncio.create_task(hold(robot, 30.0))
        await reaches(beside, least=FAST)
        rule = "{ name: night, role: watch, sites: [zug] }"
        file.write_text(f"{head}rules: [{rule}]\notherwise: drive\n", encoding="utf-8")
        with pytest.raises(UrcError):
            await driving
        await reaches(beside, most=SLOW)
        await until(lambda: refused_by(sites))
        with pytest.raises(UrcError, match="the rule “night” of the site bern"):
            await robot.command("dock")
    file.write_text(f"{head}otherwise: everybody\n", encoding="utf-8")
    path = f"/api/v1/robots/{ROBOT}@bern"
    said = ""
    async with asyncio.timeout(WAIT_S):
        while "cannot be read" not in said:
            _, found = await asyncio.to_thread(sites.zug.ask, path)
            said = found.get("message", "")
    assert said == "the rules of the site bern cannot be read, so it admits no visitors"
    shown = await asyncio.to_thread(run, "doctor", "--data-dir", str(sites.bern.data))
    assert f"{file}:3:12: error" in shown.stdout
    logs = [await asyncio.to_thread(visits, one) for one in (sites.bern, sites.zug)]
    assert {one["robot"] for one in logs[0]} == {ROBOT}
    assert {one["robot"] for one in logs[1]} == {f"{ROBOT}@bern"}
    assert {one["client"] for one in logs[0]} & {one["client"] for one in logs[1]}


def shown(site: Site) -> list[tuple[str, str, bool]]:
    """Return name, version and presence of each other site, as `urc fleet status` shows them."""
    found = json.loads(site.command("fleet", "status", "--format", "json"))
    return [(one["name"], one["version"], one["present"]) for one in found["sites"]]


def refused_by(sites: TwoSites) -> bool:
    """Return whether bern lets the visitor only watch."""
    _, found = sites.zug.ask(f"/api/v1/robots/{ROBOT}@bern")
    robot: Any = found["robot"]
    return bool(robot["role"] == "watch")


def visits(site: Site) -> list[dict[str, str]]:
    """Return the entries about visits in a site's audit log."""
    lines = site.command("audit", "--export", "-").splitlines()
    return [one for one in map(json.loads, lines) if one.get("what") == "visit"]

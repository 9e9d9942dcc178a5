"""What no other site may do: each test counts what has reached the robot, and reads one line.

The server of bern is a process of its own; the test's process is the intruder.
"""

import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from pathlib import Path

import pytest

from tests.e2e.fleet.counted_robot import NAME, CountedRobot
from tests.e2e.fleet.intruder import Intruder
from tests.e2e.fleet.two_sites import TwoSites, until_said
from urc.fleet.joining import make_fleet
from urc.fleet.membership import Membership

pytestmark = pytest.mark.anyio
HORN = f"/api/v1/robots/{NAME}/commands/horn"
TAKE = f"/api/v1/robots/{NAME}/lease"


class Yard:
    """The site bern with a robot that counts, and the certificates of other sites."""

    def __init__(self, folder: Path, sites: TwoSites, robot: CountedRobot) -> None:
        self._folder = folder
        self.sites = sites
        self.robot = robot

    def member(self, site: str) -> Membership:
        """Return a new site of the fleet, with a certificate of its own."""
        return self.sites.member(self._folder / site)

    async def hears_only(self, count: int) -> None:
        """Check that the robot has heard so many horns, the last one now from bern itself."""
        await asyncio.to_thread(until_said, self.sites.bern, HORN, {}, 200)
        await asyncio.to_thread(self.robot.hears, *["horn"] * count)

    async def logs(self, text: str) -> None:
        """Wait until the server of bern has written a line that ends with a text."""
        assert self.sites.bern.process is not None
        await self.sites.bern.process.wait_for_async(f"{text}$")


@asynccontextmanager
async def running(folder: Path) -> AsyncIterator[Yard]:
    """Run bern; its robot has been reached once, from bern itself."""
    with CountedRobot.running() as robot:
        sites = await asyncio.to_thread(TwoSites, folder, bern=[robot.document(folder)])
        sites.bern.is_emulated = False
        try:
            await asyncio.to_thread(sites.bern.start)
            await asyncio.to_thread(until_said, sites.bern, HORN, {}, 200)
            robot.hears("horn")
            yield Yard(folder, sites, robot)
        finally:
            sites.kill()


@pytest.fixture
async def yard(tmp_path: Path) -> AsyncIterator[Yard]:
    """Run bern."""
    async with running(tmp_path) as made:
        yield made


async def test_a_site_of_the_fleet_gets_through(yard: Yard) -> None:
    """Otherwise the other tests would prove nothing."""
    async with Intruder.inside(yard.member("thun")) as thun:
        await thun.sees_site()
        status, said = await thun.ask(HORN, thun.assertion(time.time()))
        assert status == 200, said
    await yard.hears_only(3)


async def test_a_replayed_assertion_gets_nothing_through(yard: Yard) -> None:
    """An old one, one of another site, and one for another site."""
    zug, thun = yard.member("zug"), yard.member("thun")
    async with Intruder.inside(zug) as own, Intruder.inside(thun) as other:
        await own.sees_site()
        await other.sees_site()
        for sender, text, fault in (
            (
                own,
                own.assertion(time.time() - 3 * 3600),
                "the assertion of the site zug ended 2 hours ago; compare the clocks of the"
                " sites zug and bern",
            ),
            (
                other,
                own.assertion(time.time()),
                "the assertion is not signed by the site that sends it",
            ),
            (
                own,
                own.assertion(time.time(), audience="thun"),
                "the assertion is from or for another site",
            ),
        ):
            for path in (HORN, TAKE):
                status, said = await sender.ask(path, text)
                assert (status, said["message"]) == (403, fault)
            await yard.logs(f"is refused: {fault}")
    await yard.hears_only(2)


async def test_a_forged_site_gets_nothing_through(yard: Yard) -> None:
    """The name on the network, and the name in an assertion."""
    zug = yard.member("zug")
    async with Intruder.inside(zug, claims="chur") as forged:
        await forged.sees_site()
        status, said = await forged.ask(HORN, forged.assertion(time.time()))
        fault = "the certificate is for the site zug, not chur"
        assert status == 0
        assert said["message"].endswith(fault)
        await yard.logs(f"a line of the site chur is refused: {fault}")
    async with Intruder.inside(zug) as forged:
        await forged.sees_site()
        fault = "the assertion is from or for another site"
        text = forged.assertion(time.time(), issuer="bern")
        assert await forged.ask(HORN, text) == (403, _forbidden(fault))
        await yard.logs(f"a visitor of the site zug is refused: {fault}")
    await yard.hears_only(2)


async def test_a_foreign_certificate_gets_nothing_through(yard: Yard, tmp_path: Path) -> None:
    """Not even into the network; behind a router that admits it, bern refuses each line."""
    now = datetime.now(UTC)
    stranger = make_fleet(tmp_path / "mill", "lab", "mill", now)
    zug = yard.member("zug")
    (tmp_path / "mill" / "fleet.json").write_bytes((zug.folder / "fleet.json").read_bytes())
    outside = Membership(
        stranger.folder, stranger.root, "bern", (), zug.connect, stranger.certificate, stranger.key
    )
    async with Intruder.inside(outside) as mill:
        await asyncio.sleep(2.0)
        status, said = await mill.ask(HORN, mill.assertion(time.time()))
        assert (status, said["message"]) == (0, "the site bern cannot be reached")
    async with Intruder.inside(outside, router=zug) as mill:
        await mill.sees_site()
        status, said = await mill.ask(HORN, mill.assertion(time.time()))
        assert status == 0
        await yard.logs(
            "a line of the site mill is refused: unable to get local issuer certificate"
        )
    await yard.hears_only(2)


async def test_commands_of_a_viewer_get_nothing_through(yard: Yard) -> None:
    """Whoever may only watch at zug can give no command and take no controls at bern."""
    sites = yard.sites
    await asyncio.to_thread(sites.zug.start)
    token = sites.zug.command("tokens", "add", "Screen", "--role", "watch").split()[0]
    far = f"/api/v1/robots/{NAME}@bern"
    await asyncio.to_thread(until_said, sites.zug, f"{far}/commands/horn", {}, 200)
    sites.zug.key = token
    status, said = await asyncio.to_thread(sites.zug.ask, far)
    assert (status, said["robot"]["role"]) == (200, "watch")
    for path, body in ((f"{far}/commands/horn", {}), (f"{far}/lease", {"action": "take"})):
        status, said = await asyncio.to_thread(sites.zug.ask, path, body)
        assert (status, said["message"]) == (403, "This needs the role drive.")
    await yard.hears_only(3)


def _forbidden(message: str) -> dict[str, str]:
    return {"code": "forbidden", "message": message, "error": message}

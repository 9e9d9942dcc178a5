"""A site whose disk is full: its robots are driven and stopped, and revocations still count."""

import asyncio
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.e2e.command_line import run
from tests.e2e.fleet.counted_robot import NAME, CountedRobot
from tests.e2e.fleet.intruder import Intruder
from tests.e2e.fleet.two_sites import TwoSites, until_said

pytestmark = [pytest.mark.anyio, pytest.mark.needs("tmpfs")]
ROBOT = f"/api/v1/robots/{NAME}"
HORN = f"{ROBOT}/commands/horn"
AUDIT = (
    "warning: urc.runtime.audit: the audit log cannot be written: database or disk is full; robots"
    " can still be driven and stopped"
)
FULL = "cannot be written: No space left on device"


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """Mount a small disk, which becomes the data folder of zug."""
    folder = tmp_path / "zug"
    folder.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=8m", "tmpfs", folder], check=True)
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", folder], check=True)


def fill(folder: Path) -> None:
    """Write until nothing fits on the disk of a folder."""
    with (folder / "filler").open("ab", buffering=0) as file:
        for size in (1 << 16, 1 << 10, 1):
            try:
                while file.write(bytes(size)):
                    pass
            except OSError:
                continue


async def test_a_full_disk_stops_no_robot_and_admits_no_revoked_site(
    tmp_path: Path, disk: Path
) -> None:
    """The server says which file cannot be written, and `urc doctor` says it too."""
    with CountedRobot.running() as robot:
        document = robot.document(tmp_path)
        sites = await asyncio.to_thread(TwoSites, tmp_path, bern=["puppet"], zug=[document])
        zug = sites.zug
        zug.is_emulated = False
        try:
            await asyncio.to_thread(sites.start_renewed)
            await asyncio.to_thread(until_said, zug, HORN, {}, 200)
            thun = sites.member(tmp_path / "thun")
            async with Intruder.inside(thun, site="zug") as visitor:
                await visitor.sees_site()
                fill(disk)
                status, said = await visitor.ask(HORN, visitor.assertion(time.time()))
                assert status == 200, said
                status, said = await visitor.ask(f"{ROBOT}/stop", visitor.assertion(time.time()))
                assert (status, said["confirmed"]) == (200, True)
                fill(disk)  # the server may have deleted a file
                await asyncio.to_thread(sites.bern.command, "fleet", "revoke", "thun")
                assert zug.process is not None
                await zug.process.wait_for_async(f"revoked.json: {FULL}$")
                status, said = await visitor.ask(HORN, visitor.assertion(time.time()))
                assert status == 0
                assert said["message"].endswith("the certificate of site thun is revoked")
            robot.hears("horn", "horn", "drive 0")
            assert zug.process.errors.count(AUDIT) == 1
            done = await asyncio.to_thread(run, "doctor", "--data-dir", str(disk))
            assert f" 0 MB are free for {disk}; delete files" in done.stdout
        finally:
            sites.kill()

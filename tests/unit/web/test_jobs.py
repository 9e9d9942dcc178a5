"""The one install that is under way: given up at any moment, agreed to once, never in the way."""

import threading
from pathlib import Path

import pytest
from anyio import to_thread

from tests.unit.packages.made import package
from urc.packages.index import IndexEntry, entry_of
from urc.packages.names import PackageError, parse_requirement
from urc.packages.package import Package
from urc.packages.sources import FileSource
from urc.packages.store import Store
from urc.web.manage.jobs import Busy, Jobs

pytestmark = pytest.mark.anyio


async def test_one_job_at_a_time_and_it_can_be_given_up(tmp_path: Path) -> None:
    """What was given up changes nothing, however late its thread comes back."""
    store = Store(tmp_path)
    jobs = Jobs(store, lambda _: [])
    dial = package("widget", "dial")
    job = jobs.begin(FileSource("dial.zip", [dial], [dial.manifest.key]))
    with pytest.raises(Busy, match="is still in progress"):
        jobs.begin(FileSource("dial.zip", [dial], [dial.manifest.key]))
    jobs.cancel(job.number)
    assert job.news().state == "cancelled"
    with pytest.raises(Busy, match="no job is waiting for approval"):
        await jobs.agree(job.number)
    with pytest.raises(Busy, match="another page"):
        jobs.cancel(job.number + 1)
    await jobs.close()
    assert store.installed() == ()


class Stalled:
    """A repository that has a package and never gives it out."""

    name = "http://stalled/"

    def __init__(self, wanted: Package) -> None:
        self.wanted = wanted
        self.asked = threading.Event()
        self.goes_on = threading.Event()

    def entries(self) -> tuple[IndexEntry, ...]:
        """Return the one package."""
        return (entry_of(self.wanted),)

    def fetch(self, _: IndexEntry) -> bytes:
        """Give it out when it is told to, which is too late."""
        self.asked.set()
        self.goes_on.wait(60)
        return self.wanted.data


async def test_a_stalled_repository_holds_up_nobody(tmp_path: Path) -> None:
    """It can be given up at once, another job begins, and what comes late changes nothing."""
    store, stalled = Store(tmp_path), Stalled(package("widget", "dial"))
    jobs = Jobs(store, lambda _: [stalled])
    job = jobs.begin(parse_requirement("widgets/dial"))
    try:
        assert await to_thread.run_sync(stalled.asked.wait, 10)
        assert job.news().line.startswith("fetching widgets/dial 1.0.0")
        jobs.cancel(job.number)
        assert job.news().state == "cancelled"
        other = package("widget", "lamp")
        second = jobs.begin(FileSource("lamp.zip", [other], [other.manifest.key]))
    finally:
        stalled.goes_on.set()
    await jobs.planned()
    assert second.news().state == "asks"
    with pytest.raises(PackageError, match="widgets/lamp: not signed"):
        await jobs.agree(second.number)
    await jobs.agree(second.number, unsigned=["widgets/lamp"])
    assert [str(lock) for lock in store.installed()] == ["widgets/lamp 1.0.0"]
    assert job.news().state == "cancelled"
    await jobs.close()

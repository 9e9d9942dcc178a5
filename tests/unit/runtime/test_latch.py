"""What survives a restart: whole or not at all, and never in the way of stopping."""

import asyncio
import errno
import json
from pathlib import Path

import pytest

from urc.motion.lease import Lease, LeaseChanged, LeaseRefused, LeaseState, Operator
from urc.runtime.latch import Latch, LatchStore

pytestmark = pytest.mark.anyio


BEFORE = ", before a restart"


async def test_what_was_kept_is_found_again(tmp_path: Path) -> None:
    """The latch and the epoch; nobody keeps the controls over a restart."""
    file = LatchStore(tmp_path / "new" / "folder", "puppet")
    assert file.load() == Latch(LeaseState())
    file.save(Latch(LeaseState(7, Operator("a"), None, 0.0, "ann")))
    await file.settle()
    found = LatchStore(tmp_path / "new" / "folder", "puppet").load()
    assert found == Latch(LeaseState(7, latched_by=f"ann{BEFORE}"))
    assert len(list((tmp_path / "new" / "folder").iterdir())) == 1, "no half file is left behind"


async def test_the_number_of_stops_goes_on_after_a_restart(tmp_path: Path) -> None:
    """A reset that names a STOP of an earlier run undoes none of this one."""
    file = LatchStore(tmp_path, "puppet")
    before = Lease()
    before.stop("ann")
    seen = before.state.stops
    file.save(Latch(before.state))
    await file.settle()
    after = Lease(LatchStore(tmp_path, "puppet").load().state)
    bob = Operator("b", "bob", "drive")
    assert isinstance(after.reset(bob), LeaseChanged)
    after.stop("eve")
    assert isinstance(after.reset(bob, seen), LeaseRefused)
    assert after.state.latched_by == "eve"


@pytest.mark.parametrize("stops", ['"3"', "-1", "null", "true", "1.5"])
def test_a_damaged_number_of_stops_does_not_hide_the_latch(tmp_path: Path, stops: str) -> None:
    text = f'{{"epoch": 3, "latched_by": "ann", "stops": {stops}}}'
    (tmp_path / "puppet.latch.json").write_text(text)
    assert LatchStore(tmp_path, "puppet").load().state == LeaseState(3, latched_by=f"ann{BEFORE}")


async def test_who_stopped_it_in_another_run_is_none_of_this_ones_screens(tmp_path: Path) -> None:
    """They are numbered from one again: screen 1 of now stopped nothing. However many runs ago."""
    file = LatchStore(tmp_path, "puppet")
    kept = Latch(LeaseState(7, latched_by="screen 1"))
    for _ in range(3):
        file.save(kept)
        await file.settle()
        kept = file.load()
        assert kept.state.latched_by == f"screen 1{BEFORE}"


@pytest.mark.parametrize("is_owed", [True, False])
async def test_whether_the_robot_heard_of_the_stop_is_kept(tmp_path: Path, is_owed: bool) -> None:
    """Whether it is latched or was reset since."""
    file = LatchStore(tmp_path, "puppet")
    for by in ("ann", ""):
        file.save(Latch(LeaseState(7, latched_by=by), is_owed))
        await file.settle()
        assert file.load().is_owed is is_owed


@pytest.mark.parametrize(("by", "is_owed"), [("ann", True), ("", False)])
def test_a_record_of_an_older_urc_does_not_say_so(tmp_path: Path, by: str, is_owed: bool) -> None:
    """The robot hears a latched stop once more."""
    (tmp_path / "puppet.latch.json").write_text(json.dumps({"epoch": 3, "latched_by": by}))
    assert LatchStore(tmp_path, "puppet").load().is_owed is is_owed


async def test_of_many_states_the_newest_is_kept(tmp_path: Path) -> None:
    """A slow disk writes fewer of them, and the last one."""
    file = LatchStore(tmp_path, "puppet")
    for epoch in range(200):
        file.save(Latch(LeaseState(epoch)))
    await file.settle()
    assert file.load().state.epoch == 199


def test_a_robot_that_was_never_driven_is_not_stopped(tmp_path: Path) -> None:
    (tmp_path / "puppet.latch.json").write_text('{"epoch": 0, "latched_by": ""}')
    assert LatchStore(tmp_path, "puppet").load().state == LeaseState(0)


@pytest.mark.parametrize(
    "text",
    [
        *("", "{", "[]", "7", "\x00" * 64),
        '{"epoch": 1}',
        '{"epoch": "1", "latched_by": ""}',
        '{"epoch": -1, "latched_by": ""}',
        '{"epoch": true, "latched_by": ""}',
    ],
)
def test_a_file_that_says_nothing_means_stopped(tmp_path: Path, text: str) -> None:
    """Nobody knows whether it was latched, so it is."""
    (tmp_path / "puppet.latch.json").write_text(text)
    found = LatchStore(tmp_path, "puppet").load()
    assert "cannot be read" in found.state.latched_by
    assert found.is_owed, "nor does anybody know whether the robot heard of it"


async def test_a_full_disk_is_told_and_harms_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The old file stays whole, and the next write that can be made is made."""
    file, told = LatchStore(tmp_path, "puppet"), list[str]()
    file.on_fault = told.append
    file.save(Latch(LeaseState(1, latched_by="ann")))
    await file.settle()

    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr("os.fsync", full)
        for epoch in (2, 2, 2):
            file.save(Latch(LeaseState(epoch)))
            await file.settle()
        assert told == ["No space left on device"], "once, however often it fails"
        assert file.fault == "No space left on device"
    assert json.loads((tmp_path / "puppet.latch.json").read_text())["epoch"] == 1
    assert len(list(tmp_path.iterdir())) == 1
    file.save(Latch(LeaseState(3)))
    await file.settle()
    assert (file.fault, file.load().state.epoch) == ("", 3)
    assert told == ["No space left on device", ""]


async def test_a_fault_without_a_number_is_told_in_its_own_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is kept here as well, for want of a listener."""
    file = LatchStore(tmp_path, "puppet")

    def broken(descriptor: int) -> None:
        raise OSError("the card was pulled out")

    monkeypatch.setattr("os.fsync", broken)
    file.save(Latch(LeaseState(1)))
    await file.settle()
    assert file.fault == "the card was pulled out"


async def test_what_could_not_be_written_is_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stop that was latched while the disk was full survives a restart after all."""
    monkeypatch.setattr("urc.runtime.latch.RETRY_S", 0.0)
    well = asyncio.Event()
    file = LatchStore(tmp_path, "puppet")
    file.on_fault = lambda fault: None if fault else well.set()

    faults = [OSError(errno.ENOSPC, "No space left on device")]

    def full(descriptor: int) -> None:
        if faults:
            raise faults.pop()

    monkeypatch.setattr("os.fsync", full)
    file.save(Latch(LeaseState(2, latched_by="ann")))
    async with asyncio.timeout(10):
        await well.wait()
    assert file.load().state.latched_by == f"ann{BEFORE}"

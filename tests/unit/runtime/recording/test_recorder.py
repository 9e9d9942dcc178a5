"""The recorder keeps what happens, whole, within its bounds, and nobody waits for it."""

import asyncio
import errno
import io
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.reader import make_reader

from urc.config.load import load_profile
from urc.model.values import Sample
from urc.problems import UrcError
from urc.runtime.hub import Hub, LogEntry
from urc.runtime.recording import recorder as module
from urc.runtime.recording.reader import open_recording
from urc.runtime.recording.recorder import Recorder, named, recorded
from urc.runtime.registries import built_in_catalog
from urc.shipped import shipped
from urc.testing.profile import line_profile

PROFILE = line_profile()
CATALOG = built_in_catalog()
DOCUMENT = "urc: 1\nkind: robot\n"


def recorder(file: Path) -> Recorder:
    return Recorder(file, PROFILE, document=DOCUMENT)


def wait(is_so: Callable[[], bool]) -> None:
    """Wait for the thread."""
    end_s = time.monotonic() + 10
    while not is_so():
        assert time.monotonic() < end_s
        time.sleep(0.001)


def readings(*values: int) -> list[Sample]:
    return [Sample("battery", value, time.monotonic()) for value in values]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "folder" / "bot.mcap"


def test_a_file_is_one_that_others_read(file: Path) -> None:
    """With its end, its index, the document, and the meaning of every topic."""
    kept = recorder(file)
    kept.record(readings(1, 2, 3))
    kept.close()
    with file.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        messages = [(channel.topic, message.data) for _, channel, message in reader.iter_messages()]
        documents = [(one.name, one.data.decode()) for one in reader.iter_attachments()]
    assert messages == [("/signals/battery", b'{"value":%d}' % value) for value in (1, 2, 3)]
    assert documents == [("profile.yaml", DOCUMENT)]
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == 3
    assert {one.encoding for one in summary.schemas.values()} == {"jsonschema"}
    assert kept.counts == Counter({"/signals/battery": 3})
    assert kept.fault == ""


def test_it_is_read_again(file: Path) -> None:
    kept = recorder(file)
    kept.record(readings(1))
    kept.close()
    found = open_recording(file)
    assert (found.document, found.unread_bytes) == (DOCUMENT, 0)
    assert [message.topic for message in found.messages(0)] == ["/signals/battery"]


def test_what_is_more_than_it_can_keep_is_counted(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file itself says how much is missing."""
    monkeypatch.setattr(module, "MOST_WAITING", 2)
    kept = recorder(file)
    with kept._wakes:  # nothing is taken meanwhile
        kept.record(readings(1, 2, 3, 4), lost=5)
    kept.close()
    texts = [message.data for message in open_recording(file).messages(0)]
    assert len(texts) == 3
    assert b"events are missing here: they arrived too fast to be written: 7" in texts[-1]


def test_what_is_too_much_in_bytes_is_counted_too(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that hangs must not cost the memory of the process that drives."""
    monkeypatch.setattr(module, "MOST_WAITING_BYTES", 10_000)
    kept = recorder(file)
    with kept._wakes:
        kept.record([Sample("note", "x" * 4000, 1.0)] * 5)
        assert (len(kept._waiting), kept._lost) == (2, 3)
    kept.close()


def test_another_recording_is_never_written_over(file: Path) -> None:
    recorder(file).close()
    kept = recorder(file)
    kept.close()
    assert kept.fault == f"{file} already exists; recordings are never overwritten"
    assert not kept.is_begun


def test_recordings_in_a_folder_have_names_of_their_own(tmp_path: Path) -> None:
    folder = tmp_path / "kept.here"
    kept = [Recorder(folder, PROFILE, is_folder=True, document=DOCUMENT) for _ in range(3)]
    for one in kept:
        one.close()
    assert len({one.file for one in kept}) == 3
    assert sorted(folder.iterdir()) == sorted(one.file for one in kept)
    assert named(folder, "bot", 1, 0.0).name == "bot-19700101T000000Z.mcap"
    assert named(folder, "bot", 2, 0.0).name == "bot-19700101T000000Z-2.mcap"


def test_a_file_that_is_removed_is_missed(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_WHOLE_S", 0.01)
    kept = recorder(file)
    wait(lambda: kept.is_begun)
    file.unlink()
    wait(lambda: kept.fault != "")
    assert kept.fault == f"{file} was deleted or moved"
    kept.close()


def test_the_document_is_in_it_without_the_folders_of_who_recorded(file: Path) -> None:
    kept = Recorder(file, load_profile(shipped("robots") / "turtlebot4.yaml", CATALOG))
    kept.record(readings(1))
    kept.close()
    document = open_recording(file).document
    assert "# turtlebot4.yaml:" in document
    assert str(shipped("robots")) not in document


@pytest.mark.parametrize(
    ("place", "said"),
    [("file/bot.mcap", "cannot be created: File exists"), (f"{'x' * 300}.mcap", "too long")],
)
def test_a_place_that_takes_no_file_is_told(tmp_path: Path, place: str, said: str) -> None:
    (tmp_path / "file").touch()
    kept = recorder(tmp_path / place)
    kept.close()
    assert said in kept.fault


def test_a_document_that_is_gone_is_told_in_the_recording(file: Path) -> None:
    """Its profile was loaded once, and the robot is driven; it can be played with another."""
    kept = Recorder(file, PROFILE)
    kept.record(readings(1))
    kept.close()
    assert kept.fault == ""
    with pytest.raises(UrcError, match=r"it contains no profile\.yaml"):
        open_recording(file)
    found = list(open_recording(file, has_profile=True).messages(0))
    assert b"the document is missing; replay the recording with --profile" in b"".join(
        m.data for m in found
    )


class FullDisk(io.BytesIO):
    """Takes the beginning, and then no more."""

    is_full = False

    def write(self, data: object) -> int:
        if self.is_full:
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(data)  # type: ignore[arg-type]

    def close(self) -> None:
        if self.is_full:
            raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize("is_full_at_once", [True, False])
def test_a_full_disk_ends_the_recording_and_says_so(
    file: Path, monkeypatch: pytest.MonkeyPatch, is_full_at_once: bool
) -> None:
    disk = FullDisk()
    disk.is_full = is_full_at_once
    monkeypatch.setattr(Recorder, "_open", lambda _: disk)
    kept = recorder(file)
    if not is_full_at_once:
        wait(lambda: kept.is_begun)
        disk.is_full = True
    kept.record(readings(1))
    kept.close()
    assert kept.fault == f"{file} cannot be written: No space left on device"
    kept.record(readings(2))  # taken by nobody, and kept nowhere
    assert not kept._waiting
    disk.is_full = False  # Python 3.13 reports what closing a forgotten file raises


def test_a_file_that_could_not_be_begun_is_not_left_behind(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Recorder, "_write_header", lambda *_: full())
    kept = recorder(file)
    kept.close()
    assert "No space left" in kept.fault
    assert not file.exists()


def full() -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_disk_that_hangs_is_waited_for_a_while_only(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    goes_on = threading.Event()
    monkeypatch.setattr(module, "_CLOSE_S", 0.05)
    monkeypatch.setattr(Recorder, "_open", lambda self: (goes_on.wait(), self.file.open("xb"))[1])
    file.parent.mkdir()
    kept = recorder(file)
    kept.record(readings(1))
    kept.close()
    assert kept.fault == f"{file}: the end of the file was not written within 0.05 s"
    goes_on.set()
    kept._thread.join()


def test_one_thing_that_cannot_be_written_costs_itself_only(file: Path) -> None:
    """A mistake of ours, or a signal that nobody declared; the file says that something is gone."""
    kept = recorder(file)
    kept.record([Sample("nobody", 1, 1.0), LogEntry(2.0, "info", "wire", "live")])
    wait(lambda: kept.counts["/log"] == 2)
    kept.close()
    assert kept.fault == ""
    texts = b"".join(message.data for message in open_recording(file).messages(0))
    assert b"an event is missing here" in texts


def test_without_the_package_it_says_how_to_get_it(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "find_spec", lambda _: None)
    kept = recorder(file)
    kept.close()
    assert kept.fault.startswith("recordings need the package mcap: ")
    assert kept.fault.endswith("'mcap<2,>=1.6'")
    assert not file.exists()


@pytest.mark.anyio
async def test_begin_and_end_of_a_recording_are_reported(tmp_path: Path) -> None:
    """With the name of the file, also for a recording that ends at once."""
    profile = load_profile(str(shipped("robots") / "puppet.yaml"), CATALOG)
    steps: list[tuple[str, str, str]] = []
    async with recorded(
        Hub({}), tmp_path, profile, is_folder=True, on_step=lambda *step: steps.append(step)
    ) as kept:
        while not steps:  # noqa: ASYNC110 - a thread creates the file
            await asyncio.sleep(0.01)
        assert steps == [("started", kept.file.name, "")]
    (file,) = tmp_path.iterdir()
    ((step, name, outcome),) = steps[1:]
    assert (step, name) == ("ended", file.name)
    # One message, if the name of the file was logged before the end.
    assert outcome in ("0 messages", "1 messages")


@pytest.mark.anyio
async def test_recording_that_fails_has_an_end_with_the_reason(tmp_path: Path) -> None:
    profile = load_profile(str(shipped("robots") / "puppet.yaml"), CATALOG)
    (tmp_path / "file").touch()
    steps: list[tuple[str, str, str]] = []
    folder = tmp_path / "file" / "kept"
    async with recorded(
        Hub({}), folder, profile, is_folder=True, on_step=lambda *step: steps.append(step)
    ) as kept:
        while not kept.fault:  # noqa: ASYNC110 - a thread sets it
            await asyncio.sleep(0.01)
    ((step, file, outcome),) = steps
    assert (step, file) == ("ended", "")
    assert "Not a directory" in outcome

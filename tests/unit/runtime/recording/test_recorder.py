"""The recorder keeps what happens, whole, within its bounds, and nobody waits for it."""

import errno
import io
import time
from collections import Counter
from pathlib import Path

import pytest
from mcap.reader import make_reader

from urc.model.values import Sample
from urc.problems import UrcError
from urc.runtime.blanking import Blanker
from urc.runtime.hub import Note
from urc.runtime.recording import recorder as module
from urc.runtime.recording.reader import open_recording
from urc.runtime.recording.recorder import Recorder, file_in
from urc.testing.profile import line_profile

PROFILE = line_profile()
DOCUMENT = "urc: 1\nkind: robot\n"


def recorder(file: Path) -> Recorder:
    return Recorder(file, PROFILE, DOCUMENT, Blanker(()))


def readings(*values: int) -> list[Sample]:
    return [Sample("battery", value, time.monotonic()) for value in values]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "folder" / "bot.mcap"


def test_a_file_is_one_that_others_read(file: Path) -> None:
    """With its end, its index, the document, and the meaning of every topic."""
    kept = recorder(file)
    kept.put(readings(1, 2, 3))
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
    kept.put(readings(1))
    kept.close()
    found = open_recording(file)
    assert (found.document, found.is_whole) == (DOCUMENT, True)
    assert [message.topic for message in found.messages(0)] == ["/signals/battery"]


def test_what_is_more_than_it_can_keep_is_counted(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file itself says how much is missing."""
    monkeypatch.setattr(module, "MOST_WAITING", 2)
    kept = recorder(file)
    with kept._wakes:  # nothing is taken meanwhile
        kept.put(readings(1, 2, 3, 4), lost=5)
    kept.close()
    texts = [message.data for message in open_recording(file).messages(0)]
    assert len(texts) == 3
    assert b"7 pieces were not recorded" in texts[-1]


def test_another_recording_is_never_written_over(file: Path) -> None:
    recorder(file).close()
    with pytest.raises(UrcError) as refused:
        recorder(file)
    assert str(refused.value) == f"{file} is there already; no recording is written over another"


def test_a_name_is_one_that_is_free(tmp_path: Path) -> None:
    first = file_in(tmp_path, "bot", 0.0)
    assert first.name == "bot-19700101T000000Z.mcap"
    first.touch()
    assert file_in(tmp_path, "bot", 0.0).name == "bot-19700101T000000Z-2.mcap"


class FullDisk(io.BytesIO):
    """Takes the beginning, and then no more."""

    is_full = False

    def write(self, data: object) -> int:
        if self.is_full:
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(data)  # type: ignore[arg-type]


def test_a_full_disk_ends_the_recording_and_says_so(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = FullDisk()
    monkeypatch.setattr(module, "_made", lambda _: disk)
    kept = recorder(file)
    disk.is_full = True
    kept.put(readings(1))
    kept.close()
    assert kept.fault == f"{file} cannot be written: No space left on device"
    kept.put(readings(2))  # taken by nobody, and kept nowhere
    assert not kept._waiting


def test_a_disk_that_is_full_at_once_is_told_in_one_line(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = FullDisk()
    disk.is_full = True
    monkeypatch.setattr(module, "_made", lambda _: disk)
    with pytest.raises(UrcError, match="cannot be written: No space left on device"):
        recorder(file)


def test_one_thing_that_cannot_be_written_costs_itself_only(file: Path) -> None:
    """A mistake of ours, or a signal that nobody declared."""
    kept = recorder(file)
    kept.put([Sample("nobody", 1, 1.0), Note(2.0, "info", "wire", "live")])
    kept.close()
    assert kept.counts["/log"] >= 1
    assert kept.fault == ""


def test_without_the_package_it_says_how_to_get_it(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "find_spec", lambda _: None)
    with pytest.raises(UrcError, match=r"pip install 'urc\[record\]'"):
        recorder(file)
    assert not file.exists()

"""Recordings are read as far as there is anything, and what is none is told in one line."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer

from urc.model.values import Sample
from urc.problems import UrcError
from urc.runtime.blanking import Blanker
from urc.runtime.hub import LinkStatus, Note
from urc.runtime.recording.reader import Recording, open_recording
from urc.runtime.recording.recorder import Recorder
from urc.testing.profile import line_profile

COUNT = 60


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A recording of several chunks: a value a second, the number of the second."""
    made = tmp_path / "bot.mcap"
    kept = Recorder(made, line_profile(), "urc: 1\n", Blanker(()))
    kept._shapes._utc_ns = lambda time_s: round(time_s * 1e9)
    kept._writer._Writer__chunk_size = 400
    for at in range(COUNT):
        kept.put([Sample("battery", at, 1000.0 + at)])
        if at == 10:
            kept.put([LinkStatus("wire", "live", "tcp", 1010.0), Note(1010.0, "info", "wire", "x")])
    kept.close()
    return made


def values(recording: Recording, from_s: float) -> list[bytes]:
    found = recording.messages(round(from_s * 1e9))
    return [message.data for message in found if message.topic == "/signals/battery"]


def test_it_is_read_from_any_moment_on(file: Path) -> None:
    found = open_recording(file)
    assert found.length_s == COUNT - 1
    assert values(found, 0) == [b'{"value":%d}' % at for at in range(COUNT)]
    assert values(found, 1055.5) == [b'{"value":%d}' % at for at in range(56, COUNT)]
    assert values(found, 2000.0) == []


def test_what_held_before_a_moment_is_the_last_of_each(file: Path) -> None:
    """Of signals and lines; a line of the log has no last that holds."""
    found = open_recording(file)
    before = {one.topic: one.data for one in found.before(1_030_500_000_000)}
    assert set(before) == {"/signals/battery", "/link/wire"}
    assert before["/signals/battery"] == b'{"value":30}'
    assert found.before(found.start_ns) == []


def opened(file: Path) -> Recording | None:
    """Return what is in a file, None where it is refused, which takes one line."""
    with suppress(UrcError):
        return open_recording(file)
    with pytest.raises(UrcError) as refused:
        open_recording(file)
    assert "\n" not in str(refused.value)
    return None


def test_a_file_that_was_cut_off_is_read_as_far_as_it_goes(file: Path, tmp_path: Path) -> None:
    whole, cut = file.read_bytes(), tmp_path / "cut.mcap"
    read = set()
    for size in range(0, len(whole), 97):
        cut.write_bytes(whole[:size])
        found = opened(cut)
        if found is None:
            continue
        assert not found.is_whole
        got = values(found, 0)
        assert got == [b'{"value":%d}' % at for at in range(len(got))]
        read.add(len(got))
    assert len(read) > 2


def test_damaged_bytes_cost_their_chunk_at_most(file: Path, tmp_path: Path) -> None:
    whole, damaged = file.read_bytes(), tmp_path / "damaged.mcap"
    for at in range(8, len(whole), 61):
        damaged.write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :])
        found = opened(damaged)
        assert found is None or len(values(found, 0)) <= COUNT


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "is no MCAP file"),
        (b"urc: 1\n", "is no MCAP file"),
        (b"\x89MCAP0\r\n", "is no MCAP file"),
    ],
)
def test_what_is_no_recording_is_told_in_one_line(tmp_path: Path, data: bytes, said: str) -> None:
    other = tmp_path / "other.mcap"
    other.write_bytes(data)
    with pytest.raises(UrcError) as refused:
        open_recording(other)
    assert str(refused.value) == f"{other} {said}"


def test_a_recording_of_another_program_is_told_in_one_line(tmp_path: Path) -> None:
    other = tmp_path / "other.mcap"
    writer: Any = Writer(str(other))
    writer.start()
    writer.add_message(writer.register_channel("/odom", "json", 0), 1, b"{}", 1)
    writer.finish()
    with pytest.raises(UrcError) as refused:
        open_recording(other)
    assert str(refused.value) == f"{other} is no recording of URC: it holds no profile.yaml"


def test_a_file_that_is_not_there_is_told_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(UrcError) as refused:
        open_recording(tmp_path)
    assert str(refused.value) == f"{tmp_path} cannot be read: Is a directory"


def test_nothing_recorded_is_told_in_one_line(tmp_path: Path) -> None:
    empty = tmp_path / "empty.mcap"
    Recorder(empty, line_profile(), "urc: 1\n", Blanker(())).close()
    with pytest.raises(UrcError) as refused:
        open_recording(empty)
    assert str(refused.value) == f"{empty} holds nothing: nothing happened while it was recorded"

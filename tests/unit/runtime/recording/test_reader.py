"""Recordings are read as far as there is anything, and what is none is told in one line."""

import io
import os
import time
import tracemalloc
from contextlib import suppress
from pathlib import Path
from typing import Any

import lz4.frame
import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk
from mcap.writer import Writer

from urc.model.values import Sample
from urc.problems import UrcError
from urc.runtime.hub import LinkStatus, LogEntry
from urc.runtime.recording import reader
from urc.runtime.recording.reader import Recording, open_recording
from urc.runtime.recording.recorder import Recorder
from urc.testing.profile import line_profile

COUNT = 60


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A recording of several chunks: a value a second, the number of the second."""
    made = tmp_path / "bot.mcap"
    kept = Recorder(made, line_profile(), document="urc: 1\n")
    while not kept.is_begun:
        time.sleep(0.001)
    kept._shapes._utc_ns = lambda time_s: round(time_s * 1e9)
    kept._writer._Writer__chunk_size = 400
    for at in range(COUNT):
        kept.record([Sample("battery", at, 1000.0 + at)])
        if at == 10:
            kept.record(
                [LinkStatus("wire", "live", "tcp", 1010.0), LogEntry(1010.0, "info", "wire", "x")]
            )
    kept.close()
    return made


def values(recording: Recording, from_s: float) -> list[bytes]:
    found = recording.messages(round(from_s * 1e9))
    return [message.data for message in found if message.topic == "/signals/battery"]


def test_it_is_read_from_any_moment_on(file: Path) -> None:
    found = open_recording(file)
    assert (found.length_s, found.unread_bytes) == (COUNT - 1, 0)
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
    for size in range(0, len(whole) - 8, 97):  # the last 8 bytes only mark the end
        cut.write_bytes(whole[:size])
        found = opened(cut)
        if found is None:
            continue
        assert found.unread_bytes
        got = values(found, 0)
        assert got == [b'{"value":%d}' % at for at in range(len(got))]
        read.add(len(got))
    assert len(read) > 2


def test_damaged_bytes_cost_their_chunk_at_most(file: Path, tmp_path: Path) -> None:
    """The rest is played, and the log says that a piece is not; nobody plays wrong numbers."""
    whole, damaged = file.read_bytes(), tmp_path / "damaged.mcap"
    right = {b'{"value":%d}' % at for at in range(COUNT)}
    told = 0
    for at in range(8, len(whole), 61):
        damaged.write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :])
        found = opened(damaged)
        if found is None:
            continue
        got = list(found.messages(0))
        assert {one.data for one in got if one.topic == "/signals/battery"} <= right
        if any(b"part of the recording cannot be read" in one.data for one in got):
            told += 1
            assert len(values(found, 0)) > COUNT / 2
    assert told > 3


def chunk(data: bytes, size: int, compression: str = "zstd") -> bytes:
    """Return the bytes of a recording with one chunk, which may say of its size what it likes."""
    stream = io.BytesIO()
    writer: Any = Writer(stream)
    writer.start()
    writer.add_attachment(1, 1, "profile.yaml", "", b"urc: 1\n")
    builder: Any = RecordBuilder()
    Chunk(compression, data, 2, 1, 0, size).write(builder)
    stream.write(builder.end())
    return stream.getvalue()


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
@pytest.mark.parametrize("size", [0, 2**40])
def test_a_bomb_is_not_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compression: str, size: int
) -> None:
    """However small it says that it is."""
    monkeypatch.setattr(reader, "_RECORD_BYTES", 1_000_000)
    pack = zstandard.compress if compression == "zstd" else lz4.frame.compress
    bomb = tmp_path / "bomb.mcap"
    bomb.write_bytes(chunk(pack(bytes(200_000_000)), size, compression))
    tracemalloc.start()
    (said,) = open_recording(bomb).messages(0)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert b"more than 1000000 bytes" in said.data
    assert most < 20_000_000


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "is not an MCAP file"),
        (b"urc: 1\n", "is not an MCAP file"),
        (b"\x89MCAP0\r\n", "is not an MCAP file"),
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
    assert other.exists()
    writer.finish()
    with pytest.raises(UrcError) as refused:
        open_recording(other)
    assert str(refused.value) == f"{other} is not a URC recording: it contains no profile.yaml"


def test_a_file_that_is_not_there_is_told_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(UrcError) as refused:
        open_recording(tmp_path / "gone")
    assert str(refused.value) == f"{tmp_path / 'gone'} cannot be read: No such file or directory"


def test_one_without_chunks_is_read(tmp_path: Path) -> None:
    """As another program may write it."""
    other = tmp_path / "other.mcap"
    writer: Any = Writer(str(other), use_chunking=False)
    writer.start()
    writer.add_message(writer.register_channel("/signals/battery", "json", 0), 7, b"{}", 7)
    writer.finish()
    found = open_recording(other, has_profile=True)
    assert list(found.messages(0)) == [(7, "/signals/battery", b"{}")]


def test_what_is_no_plain_file_is_told_in_one_line(tmp_path: Path) -> None:
    """Nobody waits for what comes out of a pipe."""
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(UrcError) as refused:
        open_recording(tmp_path / "pipe")
    assert str(refused.value) == f"{tmp_path / 'pipe'} is not a file"


def test_nothing_recorded_is_told_in_one_line(tmp_path: Path) -> None:
    empty = tmp_path / "empty.mcap"
    Recorder(empty, line_profile(), document="urc: 1\n").close()
    with pytest.raises(UrcError) as refused:
        open_recording(empty)
    assert (
        str(refused.value) == f"{empty} contains nothing to play: the recording has only just begun"
    )

"""A reader for recordings, including incomplete files left by killed processes.

Layer 4. The reader provides the recorded document, the time range, and the messages in order from
any start time. Files are read section by section, so their length is not limited.
"""

import json
import math
import os
from collections.abc import Generator, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from stat import S_ISREG
from typing import IO, Any, Final, NamedTuple

from urc.model.values import NOTHING
from urc.problems import UrcError
from urc.runtime.recording.events import is_state
from urc.runtime.recording.recorder import check_installed
from urc.runtime.recording.shapes import FILES, LOG, PROFILE
from urc.runtime.recording.videos import Group, recorded_unit
from urc.runtime.recording.widget_files import MOST_FILE_BYTES

__all__ = ["RecordedMessage", "Recording", "open_recording"]

_RECORD_BYTES: Final = 64 * 1024 * 1024
"""Maximum size of a record in bytes, before and after decompression; a longer record indicates a
damaged file."""


class RecordedMessage(NamedTuple):
    """One message in a recording."""

    time_ns: int
    """Time in nanoseconds since 1970."""
    topic: str
    data: bytes


class Recording(NamedTuple):
    """The contents of a recording."""

    file: Path
    document: str
    """Document of the robot's profile when the recording was made; "" if the file lacks it."""
    start_ns: int
    """Time of the first message, in nanoseconds since 1970."""
    end_ns: int
    topics: Mapping[Any, str] = NOTHING
    """Topic of each channel, by channel number, as listed in the summary at the end of the file."""
    unread_bytes: int = 0
    """Number of unreadable bytes at the end; -1 if the file is readable but lacks its end
    records."""
    files: Mapping[str, bytes] = NOTHING
    """Files of the robot's widgets, by their name in the document."""

    @property
    def length_s(self) -> float:
        """Length in seconds."""
        return (self.end_ns - self.start_ns) / 1e9

    def messages(self, from_ns: int) -> Generator[RecordedMessage, None, None]:
        """Yield the messages in order from a start time; stop if the end of the file is damaged.

        An unreadable section in the middle of the file is reported as a log message.
        """
        yield from _messages(self, from_ns, math.inf)

    def before(self, until_ns: int) -> list[RecordedMessage]:
        """Return the last message of each signal and transport before a given time.

        For a video, the result contains all messages from the last keyframe on.
        """
        last: dict[str, RecordedMessage] = {}
        videos: dict[str, Group[RecordedMessage]] = {}
        for message in _messages(self, 0, until_ns):
            if not is_state(message.topic):
                continue
            unit = recorded_unit(message.data)
            if unit is None:
                last[message.topic] = message
            else:
                videos.setdefault(message.topic, Group()).add(message, unit)
        found = [*last.values(), *(one for group in videos.values() for one in group.items)]
        return sorted(found, key=lambda one: one.time_ns)  # keeps the order of each video


def open_recording(file: Path, *, has_profile: bool = False) -> Recording:
    """Open a recording and return its contents.

    Args:
        file: path of the recording.
        has_profile: whether the recording is shown with a profile other than the recorded one.

    Raises:
        UrcError: the file is unreadable, empty, or not a URC recording.
    """
    check_installed()
    from mcap.records import Attachment, Channel, Chunk, Footer
    from mcap.records import Message as Written

    document, times, is_whole, size = "", [], False, 0
    topics: dict[int, str] = {}
    files: dict[str, bytes] = {}
    with _opened(file) as stream:
        for record in _records(file, stream):
            if isinstance(record, Attachment) and record.name == PROFILE:
                document = record.data.decode("utf-8", "replace")
            elif isinstance(record, Attachment) and record.name.startswith(FILES):
                if len(record.data) + sum(map(len, files.values())) <= MOST_FILE_BYTES:
                    files[record.name.removeprefix(FILES)] = record.data
            elif isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Chunk):
                times += [record.message_start_time, record.message_end_time]
            elif isinstance(record, Written):
                times.append(record.log_time)
            is_whole = isinstance(record, Footer)
            size = stream.tell()
        left = 0 if is_whole else stream.seek(0, os.SEEK_END) - size
    if not document and not has_profile:
        raise UrcError(f"{file} is not a URC recording: it contains no {PROFILE}")
    if not times:
        why = f"{left} bytes cannot be read" if left > 0 else "the recording has only just begun"
        raise UrcError(f"{file} contains nothing to play: {why}")
    unread = 0 if is_whole else left or -1
    return Recording(file, document, min(times), max(times), topics, unread, files)


def _messages(recording: Recording, from_ns: int, before_ns: float) -> Iterator[RecordedMessage]:
    from mcap.records import Channel, Chunk
    from mcap.records import Message as Written

    topics = dict(recording.topics)
    with _opened(recording.file) as stream:
        for record in _records(recording.file, stream):
            records: list[object] = [record]
            if isinstance(record, Chunk):
                if record.message_start_time >= before_ns:
                    return
                if topics and record.message_end_time < from_ns:
                    continue  # the first chunk declares the topics
                try:
                    records = [*_unpacked(record)]
                except Exception as fault:  # the library raises many types for damaged data
                    yield _unreadable(record.message_start_time, fault)
                    continue
            for one in records:
                if isinstance(one, Channel):
                    topics[one.id] = one.topic
                elif isinstance(one, Written) and from_ns <= one.log_time < before_ns:
                    yield RecordedMessage(one.log_time, topics.get(one.channel_id, ""), one.data)


def _unpacked(chunk: Any) -> Iterable[object]:
    """Return the records of a chunk; raise an error for a damaged or oversized chunk."""
    from mcap.stream_reader import breakup_chunk

    data = chunk.data
    if chunk.compression == "zstd":
        from zstandard import ZstdDecompressor

        # The library's one-shot call allocates the size that the data declares.
        with ZstdDecompressor().stream_reader(data) as reader:
            data = reader.read(_RECORD_BYTES + 1)
    elif chunk.compression == "lz4":
        from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

        data = LZ4FrameDecompressor().decompress(data, max_length=_RECORD_BYTES + 1)
    if len(data) > _RECORD_BYTES:
        raise ValueError(f"more than {_RECORD_BYTES} bytes")
    return breakup_chunk(replace(chunk, compression="", data=data), validate_crc=True)


def _unreadable(time_ns: int, fault: Exception) -> RecordedMessage:
    text = f"part of the recording cannot be read: {str(fault) or type(fault).__name__}"
    told = {"level": 3, "name": "recording", "message": text}
    return RecordedMessage(time_ns, LOG, json.dumps(told).encode())


def _opened(file: Path) -> IO[bytes]:
    try:
        if not S_ISREG(file.stat().st_mode):
            raise UrcError(f"{file} is not a file")
        return open(file, "rb")
    except OSError as error:
        raise UrcError(f"{file} cannot be read: {error.strerror or error}") from None


def _records(file: Path, stream: IO[bytes]) -> Iterator[object]:
    """Yield the records of a file up to the first unreadable record.

    Raises:
        UrcError: the file does not start like an MCAP file.
    """
    from mcap.exceptions import InvalidMagic
    from mcap.stream_reader import StreamReader

    has_begun = False
    try:
        reader = StreamReader(stream, emit_chunks=True, record_size_limit=_RECORD_BYTES)
        for record in reader.records:
            has_begun = True
            yield record
    except InvalidMagic:
        if not has_begun:
            raise UrcError(f"{file} is not an MCAP file") from None
    except OSError as error:
        raise UrcError(f"{file} cannot be read: {error.strerror or error}") from None
    except Exception:  # the library raises many types for cut or damaged files
        if not has_begun:
            raise UrcError(f"{file} is not an MCAP file") from None

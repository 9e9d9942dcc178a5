"""Reads recordings, also those of a process that was killed before their end was written.

Floor 4. Only what a player needs: the document, from when to when, and the messages in the order in
which they happened, from any moment on. A file is read piece by piece, however long it is.
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
from urc.runtime.recording.shapes import LOG, PROFILE

__all__ = ["Message", "Recording", "open_recording"]

_RECORD_BYTES: Final = 64 * 1024 * 1024
"""Of one piece of a file, also of what is packed in it; a longer one is a damaged file."""


class Message(NamedTuple):
    """One message of a recording."""

    time_ns: int
    """Since 1970."""
    topic: str
    data: bytes


class Recording(NamedTuple):
    """A file, and what was found in it."""

    file: Path
    document: str
    """The profile of the robot as it was; "" where none is kept."""
    start_ns: int
    """Time of the first message, since 1970."""
    end_ns: int
    topics: Mapping[Any, str] = NOTHING
    """Channel → topic, as the end of the file tells them once more."""
    unread_bytes: int = 0
    """Bytes at its end that cannot be read; -1: all can, and yet it has no proper end."""

    @property
    def length_s(self) -> float:
        """How long it lasts."""
        return (self.end_ns - self.start_ns) / 1e9

    def messages(self, from_ns: int) -> Generator[Message, None, None]:
        """Yield all from a moment on, in order; ends early where the file is damaged.

        A piece in the middle that cannot be read is a line of the log.
        """
        yield from _messages(self, from_ns, math.inf)

    def before(self, until_ns: int) -> list[Message]:
        """Return what held just before a moment: the last of each signal and of each line."""
        last: dict[str, Message] = {}
        for message in _messages(self, 0, until_ns):
            if is_state(message.topic):
                last[message.topic] = message
        return sorted(last.values())


def open_recording(file: Path, *, has_profile: bool = False) -> Recording:
    """Return what is in a file.

    Args:
        file: a recording.
        has_profile: whether it is played with another profile than that in it.

    Raises:
        UrcError: it cannot be read, is no recording of URC, or holds nothing.
    """
    check_installed()
    from mcap.records import Attachment, Channel, Chunk, Footer
    from mcap.records import Message as Written

    document, times, is_whole, size = "", [], False, 0
    topics: dict[int, str] = {}
    with _opened(file) as stream:
        for record in _records(file, stream):
            if isinstance(record, Attachment) and record.name == PROFILE:
                document = record.data.decode("utf-8", "replace")
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
        raise UrcError(f"{file} is no recording of URC: it holds no {PROFILE}")
    if not times:
        why = f"{left} bytes of it cannot be read" if left > 0 else "it has just been begun"
        raise UrcError(f"{file} holds nothing that can be played: {why}")
    unread = 0 if is_whole else left or -1
    return Recording(file, document, min(times), max(times), topics, unread)


def _messages(recording: Recording, from_ns: int, before_ns: float) -> Iterator[Message]:
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
                    continue  # the first one names the topics
                try:
                    records = [*_unpacked(record)]
                except Exception as fault:  # whatever a damaged piece makes the library raise
                    yield _unreadable(record.message_start_time, fault)
                    continue
            for one in records:
                if isinstance(one, Channel):
                    topics[one.id] = one.topic
                elif isinstance(one, Written) and from_ns <= one.log_time < before_ns:
                    yield Message(one.log_time, topics.get(one.channel_id, ""), one.data)


def _unpacked(chunk: Any) -> Iterable[object]:
    """Return what is in a chunk; raise something where it is damaged, or far too much."""
    from mcap.stream_reader import breakup_chunk

    data = chunk.data
    if chunk.compression == "zstd":
        from zstandard import ZstdDecompressor

        # One call of the library believes the size that the data tell, and makes room for it.
        with ZstdDecompressor().stream_reader(data) as reader:
            data = reader.read(_RECORD_BYTES + 1)
    elif chunk.compression == "lz4":
        from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

        data = LZ4FrameDecompressor().decompress(data, max_length=_RECORD_BYTES + 1)
    if len(data) > _RECORD_BYTES:
        raise ValueError(f"more than {_RECORD_BYTES} bytes")
    return breakup_chunk(replace(chunk, compression="", data=data), validate_crc=True)


def _unreadable(time_ns: int, fault: Exception) -> Message:
    text = f"a piece of the recording cannot be read: {str(fault) or type(fault).__name__}"
    told = {"level": 3, "name": "recording", "message": text}
    return Message(time_ns, LOG, json.dumps(told).encode())


def _opened(file: Path) -> IO[bytes]:
    try:
        if not S_ISREG(file.stat().st_mode):
            raise UrcError(f"{file} is no file")
        return open(file, "rb")
    except OSError as error:
        raise UrcError(f"{file} cannot be read: {error.strerror or error}") from None


def _records(file: Path, stream: IO[bytes]) -> Iterator[object]:
    """Yield the records of a file, as far as it can be read.

    Raises:
        UrcError: it does not begin like a file of this kind.
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
            raise UrcError(f"{file} is no MCAP file") from None
    except OSError as error:
        raise UrcError(f"{file} cannot be read: {error.strerror or error}") from None
    except Exception:  # the library raises what it likes where a file is cut off or damaged
        if not has_begun:
            raise UrcError(f"{file} is no MCAP file") from None

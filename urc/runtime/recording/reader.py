"""Reads recordings, also those of a process that was killed before their end was written.

Floor 4. Only what a player needs: the document, from when to when, and the messages in the order in
which they happened, from any moment on. A file is read piece by piece, however long it is.
"""

import math
from collections.abc import Generator, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

from urc.problems import UrcError
from urc.runtime.recording.recorder import check_installed
from urc.runtime.recording.shapes import PROFILE, is_state

__all__ = ["Message", "Recording", "open_recording"]

_RECORD_BYTES: Final = 512 * 1024 * 1024
"""Of one piece of a file; a longer one is a damaged file."""


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
    """The profile of the robot as it was."""
    start_ns: int
    """Time of the first message, since 1970."""
    end_ns: int
    is_whole: bool
    """Whether it ends as it should; else the last moment is missing."""

    @property
    def length_s(self) -> float:
        """How long it lasts."""
        return (self.end_ns - self.start_ns) / 1e9

    def messages(self, from_ns: int) -> Generator[Message, None, None]:
        """Yield all from a moment on, in order; ends early where the file is damaged."""
        yield from _messages(self.file, from_ns, until_ns=None)

    def before(self, until_ns: int) -> list[Message]:
        """Return what held just before a moment: the last of each signal and of each line."""
        last: dict[str, Message] = {}
        for message in _messages(self.file, 0, until_ns=until_ns):
            if is_state(message.topic):
                last[message.topic] = message
        return sorted(last.values())


def open_recording(file: Path) -> Recording:
    """Return what is in a file.

    Raises:
        UrcError: it cannot be read, is no recording of URC, or holds nothing.
    """
    check_installed()
    from mcap.records import Attachment, Chunk, Footer

    document, times, is_whole = "", [], False

    for record in _records(file):
        if isinstance(record, Attachment) and record.name == PROFILE:
            document = record.data.decode("utf-8", "replace")
        elif isinstance(record, Chunk):
            times += [record.message_start_time, record.message_end_time]
        elif isinstance(record, Footer):
            is_whole = True
    if not document:
        raise UrcError(f"{file} is no recording of URC: it holds no {PROFILE}")
    if not times:
        raise UrcError(f"{file} holds nothing: nothing happened while it was recorded")
    return Recording(file, document, min(times), max(times), is_whole)


def _messages(file: Path, from_ns: int, *, until_ns: int | None) -> Iterator[Message]:
    from mcap.records import Channel, Chunk
    from mcap.records import Message as Written
    from mcap.stream_reader import breakup_chunk

    before_ns = math.inf if until_ns is None else until_ns
    topics: dict[int, str] = {}
    for record in _records(file):
        records: list[object] = [record]
        if isinstance(record, Chunk):
            if record.message_start_time >= before_ns:
                return
            # The first one names the topics.
            if topics and record.message_end_time < from_ns:
                continue
            records = []
            with suppress(Exception):  # whatever a damaged piece makes the library raise
                records += breakup_chunk(record)
        for one in records:
            if isinstance(one, Channel):
                topics[one.id] = one.topic
            elif isinstance(one, Written) and from_ns <= one.log_time < before_ns:
                yield Message(one.log_time, topics.get(one.channel_id, ""), one.data)


def _records(file: Path) -> Iterator[object]:
    """Yield the records of a file, as far as it can be read.

    Raises:
        UrcError: it cannot be opened, or does not begin like a file of this kind.
    """
    check_installed()
    from mcap.exceptions import InvalidMagic
    from mcap.stream_reader import StreamReader

    try:
        stream = open(file, "rb")  # noqa: SIM115 - closed below
    except OSError as error:
        raise UrcError(f"{file} cannot be read: {error.strerror or error}") from None
    with stream:
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

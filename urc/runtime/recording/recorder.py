"""The recorder, which writes one session to an MCAP file.

Layer 4. Theory of operation. `Recorder.record` queues events and returns immediately. `record`
never waits for a disk, because motion uses the same event loop. A separate thread does all slow
work: reading the document, creating the file, and writing. The thread flushes the file once a
second. A killed process therefore loses at most the last second of events and the end records of
the file. If the queue is full, new events are lost, and the file contains a count of the lost
events. Of a video, all images up to the next keyframe are then left out, because they could not be
decoded. If the disk is full, the recording ends, and `fault` contains the reason.
"""

import asyncio
import json
import logging
import os
import threading
import time
from collections import Counter, deque
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import asynccontextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any, Final, Literal

from urc import __version__
from urc._extras import missing
from urc.config.resolve import resolve
from urc.model.profile import Profile
from urc.model.values import Sample
from urc.problems import UrcError
from urc.runtime.hub import EventTap, Hub, LogEntry, Tapped, Traffic
from urc.runtime.recording.shapes import PROFILE, RecordingEncoder, channels
from urc.runtime.recording.widget_files import attach_files
from urc.runtime.widget_registry import widget_folder_of
from urc.video import read_unit

__all__ = ["Recorder", "RecordingStep", "check_installed", "named", "recorded"]

RecordingStep = Callable[[Literal["started", "ended"], str, str], None]
"""Callback that receives ``started`` or ``ended``, the file's name, and the result as text."""
_SUFFIX: Final = ".mcap"
MOST_WAITING: Final = 50_000
"""Maximum number of events in the queue; further events are lost."""
MOST_WAITING_BYTES: Final = 64 * 1024 * 1024
_PIECE_BYTES: Final = 200
"""Assumed size in memory of a small event, in bytes."""
_TRIES: Final = 1000
"""Maximum number of names to try for a new file."""
_GATHER_S: Final = 0.05
"""Time for which the event loop collects events before it wakes the thread, in seconds; waking it
for each event would be slower."""
_CHUNK_BYTES: Final = 256 * 1024
"""Size of an MCAP chunk, in bytes; the library's default of 1 MiB would block the interpreter
longer."""
_SLICE: Final = 100
_PAUSE_S: Final = 0.001
"""Pause of the thread after every `_SLICE` events, in seconds, so that other threads can run."""
_WHOLE_S: Final = 1.0
_CLOSE_S: Final = 10.0
_SECOND_NS: Final = 1_000_000_000

log = logging.getLogger(__name__)


def check_installed() -> None:
    """Raise `UrcError` if the package for recordings is missing."""
    if find_spec("mcap") is None:
        raise UrcError(missing("recordings need", "mcap", "record"))


class Recorder:
    """A writer of one recording."""

    def __init__(
        self,
        place: Path,
        profile: Profile,
        *,
        is_folder: bool = False,
        document: str | None = None,
    ) -> None:
        """Start the writer thread, which creates the file.

        Args:
            place: path of a new file, or of a folder.
            profile: profile of the robot.
            is_folder: whether `place` is a folder; if so, `named` chooses the file name.
            document: the whole profile as one document; None to read the profile's file.
        """
        self.file = place
        """Path of the recording, valid when `is_begun` is true."""
        self.fault = ""
        """Reason why the recording has stopped, or ""."""
        self.is_begun = False
        """Whether the file has been created."""
        self.counts: Counter[str] = Counter()
        """Number of messages written so far, keyed by topic."""
        self._is_folder = is_folder
        self._profile = profile
        self._document = document
        # The whole file has one offset, because a change to the system clock must not shift its
        # times.
        offset_ns = time.time_ns() - time.monotonic_ns()
        self._shapes = RecordingEncoder(
            profile.driver, lambda time_s: offset_ns + round(time_s * _SECOND_NS)
        )
        self._writer: Any = None  # half of its methods have no types
        self._channels: dict[str, int] = {}
        self._waiting: deque[Tapped] = deque()
        self._waiting_bytes = 0
        self._lost = 0
        driver = profile.driver
        self._videos = {name for name, one in driver.signals.items() if one.type == "video"}
        self._broken: set[str] = set()
        """Videos of which an access unit was lost, up to their next keyframe."""
        self._wakes = threading.Condition()
        self._is_closing = False
        self._is_faulty = False
        """Whether a bug in URC has prevented the recording of an event."""
        self._thread = threading.Thread(target=self._run, name="urc-recorder", daemon=True)
        self._thread.start()

    def record(self, events: Iterable[Tapped], lost: int = 0) -> None:
        """Queue events, together with the number of events lost before them; return immediately."""
        with self._wakes:
            self._lost += lost
            if lost:
                self._broken |= self._videos
            for event in events:
                size = _size(event)
                is_full = len(self._waiting) >= MOST_WAITING
                is_full = is_full or self._waiting_bytes + size > MOST_WAITING_BYTES
                if self.fault or self._is_useless(event, is_full=is_full) or is_full:
                    self._lost += 1
                else:
                    self._waiting.append(event)
                    self._waiting_bytes += size
            self._wakes.notify()

    def _is_useless(self, event: Tapped, *, is_full: bool) -> bool:
        """Return whether an event is an access unit whose predecessors were lost."""
        if not isinstance(event, Sample) or event.signal not in self._videos:
            return False
        unit = read_unit(event.value) if isinstance(event.value, bytes) else None
        if unit is None:
            return False
        if is_full:
            self._broken.add(event.signal)
        elif unit.is_key:
            self._broken.discard(event.signal)
        return event.signal in self._broken

    def close(self) -> None:
        """Write the queued events and complete the file; take at most ten seconds."""
        with self._wakes:
            self._is_closing = True
            self._wakes.notify()
        self._thread.join(_CLOSE_S)
        if self._thread.is_alive():
            self._fail(f"{self.file}: the end of the file was not written within {_CLOSE_S:g} s")

    # -- the thread

    def _run(self) -> None:
        stream: IO[bytes] | None = None
        try:
            check_installed()
            stream = self._open()
            self._write_header(stream)
            self._follow()
            self._writer.finish()
        except UrcError as error:
            self._fail(str(error))
        except OSError as error:
            self._fail(f"{self.file} cannot be written: {error.strerror or error}")
        except Exception as error:  # supervisor: the session must continue without the recording
            log.exception("a recording failed")
            self._fail(f"{self.file}: the recording failed: {error!r}")
        finally:
            if stream is not None:
                with suppress(OSError):  # a full disk raises a second time
                    stream.close()
                if not self.is_begun:
                    with suppress(OSError):
                        self.file.unlink()

    def _open(self) -> IO[bytes]:
        place, name = self.file, self._profile.name
        try:
            (place if self._is_folder else place.parent).mkdir(parents=True, exist_ok=True)
            for number in range(1, _TRIES if self._is_folder else 2):
                self.file = named(place, name, number) if self._is_folder else place
                with suppress(FileExistsError):
                    return open(self.file, "xb")
        except OSError as error:
            raise UrcError(f"{self.file} cannot be created: {error.strerror or error}") from None
        raise UrcError(f"{self.file} already exists; recordings are never overwritten")

    def _write_header(self, stream: IO[bytes]) -> None:
        from mcap.writer import Writer  # an extra

        profile, document = self._profile, self._document
        if document is None:
            document = resolve(profile.file, widget_folder_of(profile.file), profile).text
            # Comments in the document show where each key comes from; the home folder is private.
            document = document.replace(f"# {Path(profile.file).parent}{os.sep}", "# ")
        writer: Any = Writer(stream, chunk_size=_CHUNK_BYTES)
        self._writer = writer
        writer.start(profile="", library=f"urc {__version__}")
        writer.add_metadata("urc", {"robot": profile.name, "version": __version__})
        if document:
            data, now_ns = document.encode(), time.time_ns()
            writer.add_attachment(now_ns, now_ns, PROFILE, "application/yaml", data)
            for name in attach_files(writer, profile):
                text = f"the recording lacks {name}; replay the recording with --profile"
                self.record([LogEntry(time.monotonic(), "warning", "recording", text)])
        else:
            text = f"{profile.file}: the document is missing; replay the recording with --profile"
            self.record([LogEntry(time.monotonic(), "warning", "recording", text)])
        for channel in channels(profile.driver):
            schema = json.dumps(channel.schema).encode()
            shape = writer.register_schema(channel.shape, "jsonschema", schema)
            self._channels[channel.topic] = writer.register_channel(channel.topic, "json", shape)
        writer.flush()
        self.is_begun = True

    def _follow(self) -> None:
        """Write queued events until the recorder closes."""
        whole_s = time.monotonic()
        while (batch := self._next()) is not None:
            for number, event in enumerate(batch, 1):
                self._record_event(event)
                if number % _SLICE == 0:
                    time.sleep(_PAUSE_S)
            if not batch or time.monotonic() - whole_s >= _WHOLE_S:
                self._writer.flush()
                whole_s = time.monotonic()
                if not self.file.exists():  # the system would write to a deleted file
                    raise UrcError(f"{self.file} was deleted or moved")

    def _next(self) -> list[Tapped] | None:
        """Return the queued events; [] after a second without events; None at the end."""
        with self._wakes:
            self._wakes.wait_for(lambda: self._waiting or self._is_closing, _WHOLE_S)
            batch = list(self._waiting)
            self._waiting.clear()
            self._waiting_bytes = 0
            lost, self._lost = self._lost, 0
            if lost:
                text = f"events are missing here: they arrived too fast to be written: {lost}"
                batch.append(LogEntry(time.monotonic(), "warning", "recording", text))
            if not batch and self._is_closing:
                return None
            return batch

    def _record_event(self, event: Tapped) -> None:
        try:
            self._write(self._shapes.messages(event))
        except OSError:
            raise
        except Exception:  # supervisor: only the unexpected event is lost
            if not self._is_faulty:
                log.exception("%s lacks an event of kind %s", self.file, type(event).__name__)
                text = "an event is missing here because it could not be written; see URC's log"
                self.record([LogEntry(time.monotonic(), "warning", "recording", text)])
            self._is_faulty = True

    def _write(self, messages: Iterable[tuple[str, int, bytes]]) -> None:
        for topic, time_ns, data in messages:
            self._writer.add_message(self._channels[topic], time_ns, data, time_ns)
            self.counts[topic] += 1

    def _fail(self, why: str) -> None:
        with self._wakes:
            self.fault = self.fault or why
            self._waiting.clear()
            self._waiting_bytes = 0


def _size(event: Tapped) -> int:
    """Return the approximate memory size of a queued event, in bytes."""
    held: object = None
    if isinstance(event, Traffic):
        held = event.data
    elif isinstance(event, Sample):
        held = event.value
    if isinstance(held, (bytes, str)):
        return _PIECE_BYTES + len(held)
    if isinstance(held, (tuple, Mapping)):
        return _PIECE_BYTES + 32 * len(held)
    return _PIECE_BYTES


def named(folder: Path, robot: str, number: int = 1, utc_s: float | None = None) -> Path:
    """Return the path for a recording, such as ``puppet-20261123T141502Z.mcap``.

    A `number` above 1 is added as a suffix, such as ``-2``, for a name that is already in use.
    """
    at = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(utc_s))
    more = "" if number == 1 else f"-{number}"
    return folder / f"{robot}-{at}{more}{_SUFFIX}"


@asynccontextmanager
async def recorded(
    hub: Hub,
    place: Path,
    profile: Profile,
    *,
    is_folder: bool = False,
    on_step: RecordingStep | None = None,
    document: str | None = None,
) -> AsyncIterator[Recorder]:
    """Record all events of a hub while the context is open, without delaying the hub.

    The hub's log shows the name of the file, or the reason for a failure.

    Args:
        hub: hub of the session, which redacts secrets; the session should not be open yet.
        place: path of a new file, or of a folder, as for `Recorder`.
        profile: profile of the robot, loaded from a file.
        is_folder: whether `place` is a folder; if so, a new file is created in this folder.
        on_step: callback for the creation and the end of the file.
        document: the whole profile as one document; "" means no document, and None means to read
            the profile's file.
    """
    recorder = Recorder(place, profile, is_folder=is_folder, document=document)
    steps = _Steps(recorder, on_step)
    with hub.tap(with_traffic=True) as tap:
        feeding = asyncio.create_task(_feed(tap, hub, recorder, steps))
        try:
            yield recorder
        finally:
            feeding.cancel()
            await asyncio.gather(feeding, return_exceptions=True)
            recorder.record(tap.drain())
            await asyncio.to_thread(recorder.close)
            steps.ended()


class _Steps:
    def __init__(self, recorder: Recorder, on_step: RecordingStep | None) -> None:
        self._recorder = recorder
        self._on_step = on_step
        self._is_told = False

    def look(self) -> None:
        """Report once that the file was created."""
        if self._on_step is not None and self._recorder.is_begun and not self._is_told:
            self._is_told = True
            self._on_step("started", self._recorder.file.name, "")

    def ended(self) -> None:
        """Report that the recording has ended, or why no file was created."""
        self.look()
        recorder = self._recorder
        if self._on_step is not None and (recorder.is_begun or recorder.fault):
            outcome = recorder.fault or f"{recorder.counts.total()} messages"
            self._on_step("ended", recorder.file.name if recorder.is_begun else "", outcome)


async def _feed(tap: EventTap, hub: Hub, recorder: Recorder, steps: _Steps) -> None:
    dropped, said = 0, ""
    while True:
        steps.look()
        with suppress(TimeoutError):  # the state of the file is also reported without events
            async with asyncio.timeout(_WHOLE_S):
                await tap.filled()
        recorder.record(tap.drain(), tap.dropped - dropped)
        dropped = tap.dropped
        text = _state(recorder)
        if text and text != said:
            said = text
            level: Any = "warning" if recorder.fault else "info"
            hub.log(LogEntry(time.monotonic(), level, "recording", text))
        await asyncio.sleep(_GATHER_S)


def _state(recorder: Recorder) -> str:
    if recorder.fault:
        return f"nothing is recorded{' any more' * recorder.is_begun}: {recorder.fault}"
    return f"all events are recorded in {recorder.file.name}" if recorder.is_begun else ""

"""Keeps all that happens with a robot in an MCAP file.

Floor 4. Theory of operation. `Recorder.put` takes what happened and returns: it never waits for a
disk, because motion passes by on the same loop. A thread of its own writes. Once a second what was
written is made whole, so that a process that is killed loses that second, and the end of the file,
which programs for such files can do without. When the queue is full, what comes is lost, and the
file says how much; when the disk is, nothing is written any more, and `fault` says why.
"""

import asyncio
import json
import logging
import threading
import time
from collections import Counter, deque
from collections.abc import AsyncIterator, Iterable, Mapping
from contextlib import asynccontextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any, Final

from urc import __version__
from urc.config.resolve import resolve
from urc.model.profile import Profile
from urc.model.values import Value
from urc.problems import UrcError
from urc.runtime.blanking import Blanker
from urc.runtime.hub import Hub, Note, Tap, Tapped
from urc.runtime.recording.shapes import PROFILE, Shapes, channels
from urc.runtime.shelves import shelf_of

__all__ = ["Recorder", "check_installed", "file_in", "recorded"]

_SUFFIX: Final = ".mcap"
_MISSING: Final = "recordings need the package mcap: pip install 'urc[record]'"
MOST_WAITING: Final = 50_000
"""Pieces that wait to be written."""
_GATHER_S: Final = 0.05
"""How long what happens is gathered on the loop: waking for each piece would cost more than it."""
_WHOLE_S: Final = 1.0
_CLOSE_S: Final = 10.0
_SECOND_NS: Final = 1_000_000_000

log = logging.getLogger(__name__)


def check_installed() -> None:
    """Raise `UrcError` where there is no package for recordings."""
    if find_spec("mcap") is None:
        raise UrcError(_MISSING)


class Recorder:
    """The one writer of a file."""

    def __init__(self, file: Path, profile: Profile, document: str, blanker: Blanker) -> None:
        """Make the file and start the thread that writes.

        Args:
            file: where; it must not be there yet.
            profile: of the robot.
            document: the profile as one document, as `urc.config.resolve` makes it.
            blanker: takes the values of secret settings out.

        Raises:
            UrcError: there is no package for such files, or the file cannot be made.
        """
        check_installed()
        from mcap.writer import Writer  # an extra

        self.file = file
        self.fault = ""
        """Why nothing is written any more; "" while all is well."""
        self.counts: Counter[str] = Counter()
        """Topic → messages, as far as they are written."""
        # One difference for the whole file: a clock that is set meanwhile moves nothing in it.
        offset_ns = time.time_ns() - time.monotonic_ns()
        self._shapes = Shapes(
            profile.driver, blanker, lambda time_s: offset_ns + round(time_s * _SECOND_NS)
        )
        self._stream = _made(file)
        self._writer: Any = Writer(self._stream)  # half of its methods have no types
        self._channels: dict[str, int] = {}
        self._waiting: deque[Tapped] = deque()
        self._lost = 0
        self._wakes = threading.Condition()
        self._is_closing = False
        self._is_faulty = False
        """Whether anything could not be kept because of a mistake in URC."""
        try:
            self._begin(profile, document)
        except OSError as error:
            self._stream.close()
            raise UrcError(f"{file} cannot be written: {error.strerror or error}") from None
        self._thread = threading.Thread(target=self._run, name="urc-recorder", daemon=True)
        self._thread.start()

    def put(self, events: Iterable[Tapped], lost: int = 0) -> None:
        """Take what happened, and how much was lost on the way here; returns at once."""
        with self._wakes:
            self._lost += lost
            for event in events:
                if self.fault or len(self._waiting) >= MOST_WAITING:
                    self._lost += 1
                else:
                    self._waiting.append(event)
            self._wakes.notify()

    def close(self) -> None:
        """Write what waits and the end of the file, for ten seconds at most."""
        with self._wakes:
            self._is_closing = True
            self._wakes.notify()
        self._thread.join(_CLOSE_S)

    # -- the thread

    def _begin(self, profile: Profile, document: str) -> None:
        writer = self._writer
        writer.start(profile="", library=f"urc {__version__}")
        writer.add_metadata("urc", {"robot": profile.name, "version": __version__})
        now_ns = time.time_ns()
        writer.add_attachment(now_ns, now_ns, PROFILE, "application/yaml", document.encode())
        for channel in channels(profile.driver):
            schema = json.dumps(channel.schema).encode()
            shape = writer.register_schema(channel.shape, "jsonschema", schema)
            self._channels[channel.topic] = writer.register_channel(channel.topic, "json", shape)
        writer.flush()

    def _run(self) -> None:
        try:
            whole_s = time.monotonic()
            while (batch := self._next()) is not None:
                for event in batch:
                    self._keep(event)
                now_s = time.monotonic()
                if not batch or now_s - whole_s >= _WHOLE_S:
                    whole_s = now_s
                    if not batch:
                        self._write(self._shapes.rest(now_s))
                    self._writer.flush()
            self._writer.finish()
        except OSError as error:
            self._fail(f"{self.file} cannot be written: {error.strerror or error}")
        except Exception as error:  # a supervisor: a recording that ends must end nothing else
            self._fail(f"{self.file}: the recording broke: {error!r}")
        finally:
            with suppress(OSError):
                self._stream.close()

    def _next(self) -> list[Tapped] | None:
        """Return what waits; nothing when nothing came for a second, None when it is over."""
        with self._wakes:
            self._wakes.wait_for(lambda: self._waiting or self._is_closing, _WHOLE_S)
            batch = list(self._waiting)
            self._waiting.clear()
            lost, self._lost = self._lost, 0
            if lost:
                text = f"{lost} pieces were not recorded: they came faster than they are written"
                batch.append(Note(time.monotonic(), "warning", "recording", text))
            if not batch and self._is_closing:
                return None
            return batch

    def _keep(self, event: Tapped) -> None:
        try:
            messages = self._shapes.messages(event)
        except Exception:  # a supervisor: what nobody thought of costs itself only
            if not self._is_faulty:
                log.exception("%s misses something of kind %s", self.file, type(event).__name__)
            self._is_faulty = True
            return
        self._write(messages)

    def _write(self, messages: Iterable[tuple[str, int, bytes]]) -> None:
        for topic, time_ns, data in messages:
            self._writer.add_message(self._channels[topic], time_ns, data, time_ns)
            self.counts[topic] += 1

    def _fail(self, why: str) -> None:
        with self._wakes:
            self.fault = why
            self._waiting.clear()


def _made(file: Path) -> IO[bytes]:
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        return open(file, "xb")
    except FileExistsError:
        raise UrcError(f"{file} is there already; no recording is written over another") from None
    except OSError as error:
        raise UrcError(f"{file} cannot be made: {error.strerror or error}") from None


def file_in(folder: Path, robot: str, utc_s: float | None = None) -> Path:
    """Return a name for a recording that is not taken: ``puppet-20261123T141502Z.mcap``."""
    at = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(utc_s))
    file, number = folder / f"{robot}-{at}{_SUFFIX}", 2
    while file.exists():
        file, number = folder / f"{robot}-{at}-{number}{_SUFFIX}", number + 1
    return file


@asynccontextmanager
async def recorded(
    hub: Hub, file: Path, profile: Profile, settings: Mapping[str, Value]
) -> AsyncIterator[Recorder]:
    """Keep all that a hub is told for as long as the context lasts.

    Args:
        hub: of the session, best before it is opened.
        file: where; it must not be there yet.
        profile: of the robot, from a file.
        settings: of the session; the values of secret ones are kept out.

    Raises:
        UrcError: the file cannot be made.
    """
    blanker = Blanker.of(profile, settings)
    document = await asyncio.to_thread(_document, profile)
    recorder = await asyncio.to_thread(Recorder, file, profile, document, blanker)
    with hub.tap(with_traffic=True) as tap:
        feeding = asyncio.create_task(_feed(tap, hub, recorder))
        try:
            yield recorder
        finally:
            feeding.cancel()
            await asyncio.gather(feeding, return_exceptions=True)
            recorder.put(tap.take())
            await asyncio.to_thread(recorder.close)


def _document(profile: Profile) -> str:
    """Return the profile as one document, which needs no other file but its own widgets."""
    return resolve(profile.file, shelf_of(profile.file), profile).text


async def _feed(tap: Tap, hub: Hub, recorder: Recorder) -> None:
    dropped, is_told = 0, False
    while True:
        await tap.filled()
        recorder.put(tap.take(), tap.dropped - dropped)
        dropped = tap.dropped
        if recorder.fault and not is_told:
            is_told = True
            text = f"nothing is recorded any more: {recorder.fault}"
            hub.note(Note(time.monotonic(), "warning", "recording", text))
        await asyncio.sleep(_GATHER_S)

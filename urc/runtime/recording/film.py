"""A video of a recording as an MP4 file, without decoding or changing its images.

Layer 4. Each image has the time of its arrival, so the rate of the images varies. Where access
units are missing, the film continues at the next keyframe.
"""

import io
import os
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, NamedTuple

from urc._extras import missing
from urc._h264 import BadStream, StreamInfo, info_of
from urc.model.values import NOTHING
from urc.problems import UrcError
from urc.runtime.recording.events import event_of, is_loss, topic_of
from urc.runtime.recording.reader import Recording
from urc.runtime.recording.shapes import LOG, SIGNALS
from urc.runtime.recording.videos import RecordedUnit, recorded_unit

__all__ = ["Film", "export_film"]

_TICKS: Final = 90_000
"""Ticks of the film's clock in a second, as usual for videos."""
_SECOND_NS: Final = 1_000_000_000
_PROBED: Final = 32
"""Number of access units from which the library learns whether images are sent in another order."""


class Film(NamedTuple):
    """The content of an MP4 file."""

    images: int
    length_s: float
    """Time from the first to the last image, in seconds."""
    ended: str = ""
    """Reason why the film ends before the recording; "" if it does not."""


class _Shot(NamedTuple):
    """One access unit with its time in the film."""

    data: bytes
    is_key: bool
    ticks: int


def export_film(recording: Recording, signal: str, target: Path) -> Film:
    """Write a video of a recording to a new MP4 file.

    Args:
        recording: the recording.
        signal: name of the video's signal.
        target: path of the new file.

    Raises:
        UrcError: the file exists or cannot be written, or the recording has no such video.
    """
    if find_spec("av") is None:
        raise UrcError(missing("exporting a video needs", "av", "video"))
    source = _Source(recording, signal)
    probe = source.probe()
    try:
        with open(target, "xb"):
            pass  # reserves the name, so that no other file is ever replaced
    except FileExistsError:
        raise UrcError(f"{target} exists already; select another file with --output") from None
    except OSError as error:
        raise UrcError(f"{target} cannot be written: {error.strerror or error}") from None
    try:
        # On the target's disk, so that the complete film replaces the empty file at once.
        folder = tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}.")
        with folder as place:
            part = Path(place, "film.mp4")
            film = _write(source, probe, part)
            os.replace(part, target)
    except BaseException as fault:
        with suppress(OSError):
            target.unlink()
        if not isinstance(fault, OSError):
            raise
        raise UrcError(f"{target} cannot be written: {fault.strerror or fault}") from None
    return film._replace(ended=source.ended)


class _Source:
    """The access units of one video of a recording."""

    def __init__(self, recording: Recording, signal: str) -> None:
        self._recording = recording
        self._signal = signal
        self.is_hevc = False
        self.ended = ""

    def probe(self) -> list[bytes]:
        """Return the first access units of the film, from a keyframe on."""
        found = []
        for shot in self.shots():
            found.append(shot.data)
            if len(found) == _PROBED:
                break
        return found

    def shots(self) -> Iterator[_Shot]:
        """Yield the access units from the first keyframe on, with increasing times.

        Raises:
            UrcError: the recording contains no such video, or no keyframe of it.
        """
        topic, videos, is_known, needs_key = topic_of(self._signal), set[str](), False, True
        info: StreamInfo | None = None
        began_ns = last = 0
        for message in self._recording.messages(0):
            if message.topic == LOG:
                needs_key = needs_key or _is_loss(message.data)
                continue
            is_known = is_known or message.topic == topic
            unit = recorded_unit(message.data)
            if unit is None:
                continue
            videos.add(message.topic)
            if message.topic != topic or (needs_key and not unit.is_key):
                continue
            found = _info(unit) if unit.is_key else None
            if info is None:
                info, began_ns, last, self.is_hevc = found, unit.time_ns, -1, unit.is_hevc
                if info is None:
                    continue
            elif found is not None and found != info:
                self.ended = _change(info, found, last / _TICKS)
                return
            needs_key = False
            last = max(last + 1, round((unit.time_ns - began_ns) * _TICKS / _SECOND_NS))
            yield _Shot(unit.data, unit.is_key, last)
        if info is None:
            raise UrcError(self._why_empty(videos, is_known=topic in videos, is_signal=is_known))

    def _why_empty(self, videos: set[str], *, is_known: bool, is_signal: bool) -> str:
        file, name = self._recording.file, self._signal
        if is_known:
            return f"{file} contains no keyframe of {name!r}, so no image can be decoded"
        names = ", ".join(sorted(one.removeprefix(SIGNALS) for one in videos))
        others = f"; its videos are: {names}" if names else "; it contains no video"
        if is_signal:
            return f"{name!r} is no video in {file}{others}"
        return f"{file} contains no reading of {name!r}{others}"


def _is_loss(data: bytes) -> bool:
    note: Any = event_of(LOG, data, 0.0, NOTHING)
    return note is not None and is_loss(note)


def _info(unit: RecordedUnit) -> StreamInfo | None:
    try:
        return info_of(unit.data, is_hevc=unit.is_hevc)
    except BadStream:
        return None


def _change(old: StreamInfo, new: StreamInfo, at_s: float) -> str:
    return (
        f"the video changes after {at_s:.1f} s from {old.codec} with {old.width} by {old.height}"
        f" pixels to {new.codec} with {new.width} by {new.height}"
    )


def _write(source: _Source, probe: list[bytes], part: Path) -> Film:
    """Write the film to a new file."""
    import av  # the extra `video`

    kind = "hevc" if source.is_hevc else "h264"
    base = Fraction(1, _TICKS)
    try:
        with (
            av.open(io.BytesIO(b"".join(probe)), format=kind) as head,
            av.open(str(part), "w", format="mp4", options={"movflags": "faststart"}) as target,
        ):
            pattern = head.streams.video[0]
            stream = target.add_stream_from_template(pattern)
            stream.time_base = base
            shown = _display_times(av, source, kind) if pattern.codec_context.has_b_frames else {}
            images, length = 0, 0
            for shot, duration in _with_durations(source.shots()):
                packet = av.Packet(shot.data)
                packet.stream, packet.time_base = stream, base
                packet.dts, packet.duration = shot.ticks, duration
                packet.pts = shown.get(images, shot.ticks)
                packet.is_keyframe = shot.is_key
                target.mux(packet)
                images, length = images + 1, shot.ticks
    except (av.error.FFmpegError, IndexError) as fault:
        if isinstance(fault, OSError):
            raise
        raise UrcError(f"the video cannot be written as MP4: {fault}") from None
    return Film(images, length / _TICKS)


def _with_durations(shots: Iterator[_Shot]) -> Iterator[tuple[_Shot, int]]:
    """Yield each access unit with the time until the next one, in ticks."""
    waiting: _Shot | None = None
    duration = _TICKS // 30
    for shot in shots:
        if waiting is not None:
            duration = shot.ticks - waiting.ticks
            yield waiting, duration
        waiting = shot
    if waiting is not None:
        yield waiting, duration


def _display_times(av: Any, source: _Source, kind: str) -> dict[int, int]:
    """Return the display time of each access unit in ticks, keyed by its place.

    Encoders with B-frames send images in another order than they are shown. Only a decoder knows
    the order.
    """
    decoder = av.CodecContext.create(kind, "r")
    ticks: list[int] = []
    order: list[int] = []

    def decode(packet: Any) -> None:
        with suppress(av.error.FFmpegError):  # a damaged image is not shown
            order.extend(frame.pts for frame in decoder.decode(packet))

    for place, shot in enumerate(source.shots()):
        packet = av.Packet(shot.data)
        packet.pts = packet.dts = place
        ticks.append(shot.ticks)
        decode(packet)
    decode(None)
    delay = max((place - position for position, place in enumerate(order)), default=0)
    step = ticks[-1] - ticks[-2] if len(ticks) > 1 else 1
    ticks += [ticks[-1] + step * (more + 1) for more in range(delay)]
    return {place: ticks[position + delay] for position, place in enumerate(order)}

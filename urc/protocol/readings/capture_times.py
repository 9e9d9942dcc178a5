"""Times of capture in messages with images, such as ``header.stamp``.

Pure. A time of capture can make the image of its message older, never younger than its arrival; see
`urc.capture_clock`. The reader of a message also reads the parts that may contain a time. These
hidden fields have names that no document can contain.
"""

from collections.abc import Callable, Mapping
from typing import Final

from urc.capture_clock import CaptureClock, step_words
from urc.model.payload import LOST, Payload, ReadSpec
from urc.model.text import JsonPath
from urc.model.values import Sample, Signal
from urc.protocol.readings.readings import Decode
from urc.protocol.values.payload import Frame, PayloadReader
from urc.protocol.values.video_message import GAP
from urc.video import JPEG, arrival_s, read_unit, with_time

__all__ = ["StampedReader", "arriving", "capture_paths", "dating", "stamp_s", "with_captures"]

_TYPES: Final = ("image", "video")
_PLACES: Final[tuple[JsonPath, ...]] = (("header", "stamp"), ("timestamp",))
"""Places of the time in a message: in ROS, and in the schemas of Foxglove."""
_DATA: Final = "data"
_HIDDEN: Final = "_ captured"
"""Start of the names of hidden fields; the blank sets them apart from all names in documents."""
_BEGIN_S: Final = 10**9
"""Earliest time of day, in September 2001. Earlier stamps count from the start of a robot, or of a
simulation, which may be slower than real time."""
_END_S: Final = 2**40


def capture_paths(read: ReadSpec, signals: Mapping[str, Signal]) -> dict[str, tuple[JsonPath, ...]]:
    """Return where a message may contain the time of capture of its images, keyed by signal."""
    paths = read.options.get("paths")
    if read.form != "json" or read.topic is None or not isinstance(paths, Mapping):
        return {}
    found: dict[str, tuple[JsonPath, ...]] = {}
    for name, path in paths.items():
        signal = signals.get(name)
        if signal is None or signal.type not in _TYPES or not signal.has_capture_time:
            continue
        if isinstance(path, tuple):  # an expression may choose one of several images
            around = path[:-1] if path[-1:] == (_DATA,) else path
            found[name] = tuple((*around, *place) for place in _PLACES)
    return found


def with_captures(read: ReadSpec, captures: Mapping[str, tuple[JsonPath, ...]]) -> ReadSpec:
    """Return a declaration that also reads the times of capture, as hidden fields."""
    paths: dict[str, object] = {**_paths(read)}
    for name, places in captures.items():
        paths.update({_hidden(name, place): path for place, path in enumerate(places)})
    return read._replace(options={**read.options, "paths": paths})


def _paths(read: ReadSpec) -> Mapping[str, object]:
    paths = read.options.get("paths")
    return paths if isinstance(paths, Mapping) else {}


def _hidden(name: str, place: int) -> str:
    return f"{_HIDDEN} {name} {place}"


class StampedReader:
    """A reader for a message with hidden fields, which alone are no match.

    A hidden field also tells whether messages were lost before this one.
    """

    def __init__(self, reader: PayloadReader) -> None:
        self._reader = reader

    def read(self, frame: Frame) -> Mapping[str, object] | None:
        """Return the fields; None if the frame does not match."""
        found = self._reader.read(frame)
        if found is None or all(name.startswith(_HIDDEN) for name in found):
            return None
        return {**found, GAP: True} if frame.attributes.get(LOST) else found

    def write(self, fields: Mapping[str, object]) -> Payload:
        """Return a frame with `fields`; raise `NotWritable` if impossible."""
        return self._reader.write(fields)


def dating(
    captures: Mapping[str, tuple[JsonPath, ...]],
    clocks: dict[str, CaptureClock],
    note: Callable[[str], None],
    decode: Decode,
) -> Decode:
    """Return a variant of `decode` that makes images older as their times of capture state.

    Args:
        captures: result of `capture_paths`.
        clocks: comparison of each signal's clock; missing clocks are added.
        note: function that receives a line for the log.
        decode: function that converts the fields to samples.
    """

    def dated(sample: Sample, found: Mapping[str, object], now: float) -> Sample:
        name = sample.signal
        places = captures.get(name)
        if places is None or sample.value is None:
            return sample
        stamps = (stamp_s(found.get(_hidden(name, place))) for place in range(len(places)))
        captured_s = next((one for one in stamps if one is not None), None)
        if captured_s is None:
            return sample
        age = clocks.setdefault(name, CaptureClock()).age(captured_s, now)
        if age.step_s:
            note(f"{name}: {step_words(age.step_s)}")
        if not age.older_s:
            return sample
        value, time_s = sample.value, sample.time_s - age.older_s
        if isinstance(value, bytes) and read_unit(value) is not None:
            value = with_time(value, time_s)
        return sample._replace(value=value, time_s=time_s)

    def decode_dated(found: Mapping[str, object], now: float) -> tuple[list[Sample], list[str]]:
        samples, refused = decode(found, now)
        return [dated(one, found, now) for one in samples], refused

    return decode_dated


def arriving(decode: Decode) -> Decode:
    """Return a variant of `decode` for the JPEG images of a camera of this computer.

    The camera's process states when each image was captured. An image that waits for a busy server
    therefore becomes older.
    """

    def decode_arrived(found: Mapping[str, object], now: float) -> tuple[list[Sample], list[str]]:
        files: dict[str, object] = {}
        times_s: dict[str, float] = {}
        faults = []
        for name, value in found.items():
            unit = read_unit(value) if isinstance(value, bytes) else None
            if unit is not None and unit.codec != JPEG:
                faults.append(
                    f"{name}: the camera sends a video; declare the signal as type: video"
                )
                continue
            files[name] = value if unit is None else unit.data
            if unit is not None:
                times_s[name] = arrival_s(unit, now)
        samples, refused = decode(files, now)
        dated = [one._replace(time_s=times_s.get(one.signal, one.time_s)) for one in samples]
        return dated, [*refused, *faults]

    return decode_arrived


def stamp_s(stamp: object) -> float | None:
    """Return a time of day in seconds; None for any other stamp, and for anything else.

    ROS 1 has other names for the parts, and servers of Foxglove have a third form in JSON.
    """
    if not isinstance(stamp, Mapping):
        return None
    whole = stamp.get("sec", stamp.get("secs"))
    part = stamp.get("nanosec", stamp.get("nsecs", stamp.get("nsec")))
    if type(whole) is not int or type(part) is not int:
        return None
    if not (0 <= part < 10**9 and _BEGIN_S <= whole < _END_S):
        return None
    return whole + part / 1e9

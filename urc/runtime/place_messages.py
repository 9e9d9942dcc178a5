"""Poses, positions on the Earth and laser scans as Foxglove's standard messages.

Layer 4. Pure. A signal on its own is a number or a list whose meaning is unknown. The widgets of a
profile supply the meaning: a map shows the robot's position, and a scan shows distances around the
robot.

Positions are in metres and angles in radians, as in REP 103. JSON has no number for an unknown
distance, so the message contains 0, which is below the minimum of every sensor.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, Final, NamedTuple

from urc.model.interface import WidgetUse
from urc.model.profile import Profile
from urc.model.units import conversion
from urc.model.values import Reading, Sample, Signal
from urc.runtime.foxglove_schemas import LASER_SCAN, LOCATION_FIX, POSE_IN_FRAME
from urc.runtime.json_messages import MessageSchema, as_json, stamp

__all__ = ["PlaceSource", "place_sources"]

_UNITS: Final = {
    **dict.fromkeys(("x", "y", "accuracy", "ranges"), "m"),
    **dict.fromkeys(("yaw", "heading", "angle_min", "angle_increment"), "rad"),
    **dict.fromkeys(("latitude", "longitude"), "deg"),
}
"""Unit of each input's values in messages."""
_USUAL: Final = {"heading": "deg"}
"""Assumed unit of an input whose signal declares no unit; by default, the unit in messages."""
_UPRIGHT: Final = {
    "position": {"x": 0.0, "y": 0.0, "z": 0.0},
    "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
}
_COVARIANCE: Final = 9

Latest = Callable[[str], Sample | None]
_Values = Mapping[str, Any]
_Build = Callable[[WidgetUse, _Values], dict[str, object] | None]


class PlaceSource(NamedTuple):
    """The source of one widget's messages: poses, positions or scans."""

    slot: str
    """Name of the widget's slot."""
    shape: MessageSchema
    frame: str
    """Name of the coordinate frame to which the messages refer."""
    inputs: Mapping[str, str]
    """Signals, keyed by input of the widget."""
    units: Mapping[str, Callable[[float], float]]
    """Conversion of each input to the unit in messages."""
    build: Callable[[_Values], dict[str, object] | None]

    def message(self, latest: Latest, utc_ns: Callable[[float], int]) -> tuple[int, bytes] | None:
        """Return the time in nanoseconds since 1970 and the JSON text, or None without a value.

        Args:
            latest: function that returns the newest reading of a signal.
            utc_ns: function that converts the time of a reading to nanoseconds since 1970.
        """
        found = {name: latest(signal) for name, signal in self.inputs.items()}
        known = {name: one for name, one in found.items() if one is not None}
        values = {name: self._converted(name, one.value) for name, one in known.items()}
        told = self.build(values)
        if told is None:
            return None
        time_ns = utc_ns(max(one.time_s for one in known.values()))
        head = {"timestamp": stamp(time_ns), "frame_id": self.frame}
        return time_ns, as_json({**head, **told})

    def _converted(self, name: str, value: Reading) -> Reading:
        convert = self.units.get(name)
        if convert is None:
            return value
        if name != "ranges":
            return _number(value, convert)
        return tuple(_number(one, convert) for one in value) if isinstance(value, tuple) else None


def place_sources(robot: str, profile: Profile) -> tuple[PlaceSource, ...]:
    """Return the poses, positions and scans that a profile's widgets show.

    Args:
        robot: name of the robot, the first part of the names of coordinate frames.
        profile: profile of the robot.
    """
    return tuple(_sources(robot, profile))


def _sources(robot: str, profile: Profile) -> Iterator[PlaceSource]:
    uses = dict(profile.slots)
    for interface in profile.interfaces.values():
        uses = {**interface.widgets, **uses}
    for slot, use in uses.items():
        widget = profile.widgets.get(use.widget)
        kind = widget.folder.name if widget is not None else ""
        found: tuple[str, Mapping[str, Any], str, _Build] | None = None
        if kind == "scan" and "ranges" in use.inputs and "angles" not in use.inputs:
            found = "foxglove.LaserScan", LASER_SCAN, f"{robot}/base", _scan
        elif kind == "map" and {"latitude", "fix"} & use.inputs.keys():
            found = "foxglove.LocationFix", LOCATION_FIX, f"{robot}/base", _fix
        elif kind == "map" and {"x", "y"} <= use.inputs.keys():
            found = "foxglove.PoseInFrame", POSE_IN_FRAME, f"{robot}/map", _pose
        if found is not None:
            name, schema, frame, build = found
            signals = profile.driver.signals
            units = {
                each: _conversion(each, signals[signal])
                for each, signal in use.inputs.items()
                if each in _UNITS and signal in signals
            }
            shape, built = MessageSchema(name, schema), partial(build, use)
            yield PlaceSource(slot, shape, frame, use.inputs, units, built)


def _conversion(name: str, signal: Signal) -> Callable[[float], float]:
    have, want = signal.unit or _USUAL.get(name, ""), _UNITS[name]
    scale = conversion(have, want) if have else None
    if scale is None:
        return float
    return scale.__call__


def _scan(use: WidgetUse, values: _Values) -> dict[str, object] | None:
    ranges = values.get("ranges")
    if not ranges:
        return None
    start = _angle(use, values, "angle_min", -math.pi)
    step = _angle(use, values, "angle_increment", 2 * math.pi / len(ranges))
    if start is None or step is None:
        return None  # dots in wrong directions would hide a real obstacle
    return {
        "pose": _UPRIGHT,
        "start_angle": start,
        "end_angle": start + step * (len(ranges) - 1),
        "ranges": [one if one is not None else 0.0 for one in ranges],
        "intensities": [],
    }


def _angle(use: WidgetUse, values: _Values, name: str, usual: float) -> float | None:
    if name in use.inputs:
        found: float | None = values.get(name)
        return found
    option = use.options.get(name)
    return float(option) if isinstance(option, (int, float)) else usual


def _pose(use: WidgetUse, values: _Values) -> dict[str, object] | None:
    x, y = values.get("x"), values.get("y")
    yaw = 0.0
    if "heading" in use.inputs:
        heading = values.get("heading")
        yaw = math.pi / 2 - heading if heading is not None else math.nan
    elif "yaw" in use.inputs:
        found = values.get("yaw")
        yaw = found if found is not None else math.nan
    if x is None or y is None or math.isnan(yaw):
        return None
    turned = {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
    return {"pose": {"position": {"x": x, "y": y, "z": 0.0}, "orientation": turned}}


def _fix(use: WidgetUse, values: _Values) -> dict[str, object] | None:
    fix = values.get("fix")
    found = _satellite_fix(fix) if isinstance(fix, Mapping) else {}
    latitude = found.get("latitude", values.get("latitude"))
    longitude = found.get("longitude", values.get("longitude"))
    if latitude is None or longitude is None or ("fix" in use.inputs and not found):
        return None
    told = {
        "latitude": latitude,
        "longitude": longitude,
        "altitude": found.get("altitude", 0.0),
        "position_covariance": found.get("position_covariance", [0.0] * _COVARIANCE),
        "position_covariance_type": found.get("position_covariance_type", 0),
    }
    accuracy, heading = values.get("accuracy"), values.get("heading")
    if accuracy is not None:
        told["position_covariance"] = [accuracy**2, 0.0, 0.0, 0.0, accuracy**2, *[0.0] * 4]
        told["position_covariance_type"] = 1
    if heading is not None:
        told["heading"] = heading
    return told


def _satellite_fix(fix: Mapping[str, Any]) -> dict[str, Any]:
    """Return the known fields of a message such as NavSatFix; {} if there is no position."""
    status = fix.get("status")
    state = status.get("status") if isinstance(status, Mapping) else status
    names = ("latitude", "longitude", "altitude")
    numbers = {name: _number(fix.get(name)) for name in names}
    found: dict[str, Any] = {name: one for name, one in numbers.items() if one is not None}
    if (isinstance(state, (int, float)) and state < 0) or not {*names[:2]} <= found.keys():
        return {}
    covariance = fix.get("position_covariance")
    kind = fix.get("position_covariance_type")
    cells = [_number(one) for one in covariance] if isinstance(covariance, tuple) else []
    if len(cells) == _COVARIANCE and None not in cells and kind in (1, 2, 3):
        found |= {"position_covariance": cells, "position_covariance_type": int(kind)}
    return found


def _number(value: object, convert: Callable[[float], float] = float) -> float | None:
    """Return a finite number in another unit; None for any other value."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        number = convert(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None

"""Poses, positions on the Earth and scans, as Foxglove's viewers draw them."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import jsonschema
import pytest

from urc.model.interface import WidgetUse
from urc.model.values import Reading, Sample, Signal
from urc.runtime.place_messages import PlaceSource, place_sources
from urc.testing.dashboard import dashboard_profile

NS = 1_700_000_000_000_000_000
SIGNALS = (
    Signal("ranges", "array", unit="cm"),
    Signal("first", unit="deg"),
    Signal("step", unit="rad"),
    Signal("x", unit="mm"),
    Signal("y", unit="m"),
    Signal("yaw", unit="rad"),
    Signal("course", unit="deg"),
    Signal("lat", unit="deg"),
    Signal("lon", unit="deg"),
    Signal("spread", unit="m"),
    Signal("fix", "object"),
    Signal("angles", "array", unit="rad"),
)


def sources(*uses: WidgetUse) -> tuple[PlaceSource, ...]:
    profile = dashboard_profile(signals={one.name: one for one in SIGNALS}, uses=uses)
    return place_sources("cart", profile)


def told(use: WidgetUse, readings: Mapping[str, Reading]) -> Any:
    """Return the message of a widget, which fits the schema that is announced."""
    (source,) = sources(use)
    samples = {name: Sample(name, value, 1.0) for name, value in readings.items()}
    found = source.message(samples.get, lambda time_s: NS + round(time_s * 1e9))
    if found is None:
        return None
    time_ns, data = found
    assert time_ns == NS + 1_000_000_000
    message = json.loads(data, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
    jsonschema.validate(message, dict(source.shape.schema))
    assert message["timestamp"] == {"sec": 1_700_000_001, "nsec": 0}
    return message


SCAN = WidgetUse(
    "laser", "scan", {"ranges": "ranges", "angle_min": "first", "angle_increment": "step"}
)


def test_a_scan_has_metres_and_radians() -> None:
    ranges = (100.0, None, 250.0, math.inf)
    message = told(SCAN, {"ranges": ranges, "first": -90.0, "step": 0.5})
    assert message["frame_id"] == "cart/base"
    assert message["ranges"] == [1.0, 0.0, 2.5, 0.0]
    assert message["start_angle"] == pytest.approx(-math.pi / 2)
    assert message["end_angle"] == pytest.approx(-math.pi / 2 + 1.5)
    assert message["intensities"] == []


def test_a_scan_without_angles_covers_a_full_turn_from_straight_behind() -> None:
    message = told(WidgetUse("laser", "scan", {"ranges": "ranges"}), {"ranges": (1, 1, 1, 1)})
    assert message["start_angle"] == pytest.approx(-math.pi)
    assert message["end_angle"] == pytest.approx(math.pi / 2)


@pytest.mark.parametrize("first", [None, "left"])
def test_a_scan_of_unknown_directions_is_not_told(first: Reading) -> None:
    """Dots in wrong directions would hide a real obstacle."""
    assert told(SCAN, {"ranges": (1.0,), "first": first, "step": 0.5}) is None
    assert told(SCAN, {"ranges": (1.0,), "step": 0.5}) is None
    assert told(SCAN, {"ranges": (), "first": 0, "step": 0.5}) is None


def test_uneven_rays_fit_no_message() -> None:
    assert sources(WidgetUse("laser", "scan", {"ranges": "ranges", "angles": "angles"})) == ()


POSES: Sequence[tuple[dict[str, str], dict[str, Reading], float]] = (
    ({"yaw": "yaw"}, {"yaw": math.pi / 2}, math.pi / 2),
    ({"heading": "course"}, {"course": 0.0}, math.pi / 2),
    ({"heading": "course"}, {"course": 90.0}, 0.0),
    ({}, {}, 0.0),
)


@pytest.mark.parametrize(("inputs", "readings", "yaw"), POSES)
def test_a_pose_has_metres_and_a_turn_counter_clockwise_from_x(
    inputs: dict[str, str], readings: dict[str, Reading], yaw: float
) -> None:
    use = WidgetUse("map", "map", {"x": "x", "y": "y", **inputs})
    message = told(use, {"x": 1500, "y": -2.0, **readings})
    assert message["frame_id"] == "cart/map"
    assert message["pose"]["position"] == {"x": 1.5, "y": -2.0, "z": 0.0}
    turned = message["pose"]["orientation"]
    assert 2 * math.atan2(turned["z"], turned["w"]) == pytest.approx(yaw)


def test_a_pose_without_a_value_is_not_told() -> None:
    use = WidgetUse("map", "map", {"x": "x", "y": "y", "yaw": "yaw"})
    assert told(use, {"x": 1, "y": 1}) is None
    assert told(use, {"x": None, "y": 1, "yaw": 0}) is None
    assert told(use, {}) is None


def test_a_position_on_the_earth() -> None:
    inputs = {"latitude": "lat", "longitude": "lon", "heading": "course", "accuracy": "spread"}
    message = told(
        WidgetUse("map", "map", inputs), {"lat": 46.5, "lon": 6.5, "course": 90, "spread": 2}
    )
    assert (message["latitude"], message["longitude"]) == (46.5, 6.5)
    assert message["heading"] == pytest.approx(math.pi / 2)
    assert message["position_covariance"] == [4, 0, 0, 0, 4, 0, 0, 0, 0]
    assert message["position_covariance_type"] == 1


def test_a_satellite_fix_keeps_its_altitude_and_covariance() -> None:
    use = WidgetUse("map", "map", {"fix": "fix"})
    fix = {
        "status": {"status": 0},
        "latitude": 46.5,
        "longitude": 6.5,
        "altitude": 400.5,
        "position_covariance": (1.0, 0, 0, 0, 2.0, 0, 0, 0, 3.0),
        "position_covariance_type": 2,
    }
    message = told(use, {"fix": fix})
    assert message["altitude"] == 400.5
    assert message["position_covariance"] == [1, 0, 0, 0, 2, 0, 0, 0, 3]
    assert message["position_covariance_type"] == 2
    for bad in ({"status": {"status": -1}}, {"latitude": None}, {"longitude": math.nan}):
        assert told(use, {"fix": {**fix, **bad}}) is None


@pytest.mark.parametrize("value", [True, "far", b"\x00", {"a": 1}, 10**400, (1.0,)])
def test_no_value_of_a_robot_raises(value: Reading) -> None:
    assert told(WidgetUse("map", "map", {"x": "x", "y": "y"}), {"x": value, "y": 1}) is None

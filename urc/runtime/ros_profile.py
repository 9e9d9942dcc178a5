"""The profile of a mobile base, written from the topics that a ROS robot reports.

Layer 4. Pure. The document contains what the robot is: its parts and the type of its commands. The
address and the names of the topics are settings, so they can be changed on the settings page.
"""

import json
from collections.abc import Mapping
from typing import Final, NamedTuple

from urc.problems import UrcError
from urc.transports.ros.topic_list import TopicList, TopicRow, short_type

__all__ = ["PARTS", "BaseProfile", "RobotPart", "candidates", "document_of", "settings_of"]


class RobotPart(NamedTuple):
    """One part of a mobile base, and the ROS types of its topic."""

    name: str
    types: tuple[str, ...]
    usual: tuple[str, ...]
    """Usual names of the topic, best first; a namespace may precede the name."""
    is_taken: bool = False
    """Whether the robot subscribes to the topic, instead of publishing it."""


TWIST: Final = "geometry_msgs/Twist"
STAMPED: Final = "geometry_msgs/TwistStamped"
PARTS: Final = (
    RobotPart("cmd_vel", (STAMPED, TWIST), ("cmd_vel",), is_taken=True),
    RobotPart("odom", ("nav_msgs/Odometry",), ("odom", "odometry")),
    RobotPart("scan", ("sensor_msgs/LaserScan",), ("scan",)),
    RobotPart("camera", ("sensor_msgs/CompressedImage",), ("image_raw/compressed",)),
    RobotPart("battery", ("sensor_msgs/BatteryState",), ("battery_state", "battery")),
    RobotPart("map", ("nav_msgs/OccupancyGrid",), ("map",)),
    RobotPart("imu", ("sensor_msgs/Imu",), ("imu", "imu/data")),
)
"""The parts of a mobile base, in the order in which pages ask for them."""
MOST: Final = 50
"""Maximum number of topics that are offered for one part."""
_TESTS: Final = {
    "scan": ("a sweep with a beam that saw nothing",),
    "battery": ("four fifths of the battery, and a current that is not measured",),
    "imu": ("ten degrees of roll, twenty of pitch and thirty of yaw",),
    "camera": ("a picture of the camera, in base64",),
}
"""Tests of the driver that need a message of each part."""


class BaseProfile(NamedTuple):
    """The decisions about a new robot."""

    name: str
    """Name in lower-case letters, digits and ``-``."""
    title: str
    host: str
    port: int
    via: str
    """Kind of the connection: ``rosbridge``, ``foxglove`` or ``zenoh``."""
    version: int
    """ROS version, 1 or 2."""
    topics: Mapping[str, str]
    """Topic of each part that the robot has, keyed by part. ``cmd_vel`` and ``odom`` are needed."""
    is_stamped: bool
    """Whether the robot takes `STAMPED` instead of `TWIST`."""


def candidates(listed: TopicList) -> dict[str, list[tuple[str, str]]]:
    """Return the topic and type of each topic that fits a part, best first, keyed by part.

    A type is "" if the connection does not know it: rosapi of ROS 1 knows only published types.
    """
    found: dict[str, list[tuple[str, str]]] = {}
    for part in PARTS:
        fits = [
            (_rank(part, row, kind), row.name, kind)
            for row in listed.rows
            if (kind := _fitting(part, row)) is not None and _is_writable(row.name)
        ]
        found[part.name] = [(name, kind) for _, name, kind in sorted(fits)[:MOST]]
    return found


def _fitting(part: RobotPart, row: TopicRow) -> str | None:
    """Return the type of a topic that fits a part, "" for an unknown type; None if none fits."""
    types = {short_type(kind) for kind in (row.takes if part.is_taken else row.carries) or ()}
    nodes = row.subscribers if part.is_taken else row.publishers
    if nodes == ():
        return None
    is_usual = row.name.rpartition("/")[2] in part.usual
    if part.is_taken and nodes and not types and is_usual:
        return ""
    return next((kind for kind in part.types if kind in types), None)


def _rank(part: RobotPart, row: TopicRow, kind: str) -> tuple[int, int]:
    """Return the order of a topic among those that fit: the usual name first, then short names."""
    name = row.name.strip("/")
    place = next(
        (at for at, one in enumerate(part.usual) if name == one or name.endswith(f"/{one}")),
        len(part.usual),
    )
    return place, name.count("/")


def _is_writable(name: str) -> bool:
    return name.replace("/", "").replace("_", "").isalnum() and name.isascii()


def settings_of(base: BaseProfile) -> dict[str, str]:
    """Return the settings of the robot as text, keyed by setting."""
    found = {"host": base.host, "port": str(base.port), "bridge": base.via}
    topics = {name: topic for name, topic in base.topics.items() if topic}
    if base.version == 1:
        topics.pop("map", None)  # goals need Nav2
    return found | topics


def document_of(base: BaseProfile) -> str:
    """Return the robot's document as YAML.

    Raises:
        UrcError: the robot takes no commands or reports no position, so it could not be driven.
    """
    for needed in ("cmd_vel", "odom"):
        if not base.topics.get(needed):
            raise UrcError(f"a mobile base needs a topic for {needed}")
    has = {name for name, topic in base.topics.items() if topic}
    has_map = "map" in has and base.version == 2
    params = {"ros": base.version, "speed": 0.5, "back": -0.5, "turn": 1.0, "right": -1.0}
    flow = ", ".join(f"{name}: {value}" for name, value in params.items())
    stamped = ", stamped: true" if base.is_stamped else ""
    navigation = ", navigation: true" if has_map else ""
    lines = [
        "# Written by URC from the robot's topics. The speeds are limits of this page: check them.",
        "urc: 1",
        "kind: robot",
        f"name: {base.name}",
        f"title: {json.dumps(base.title, ensure_ascii=False)}",
        f"summary: A mobile base with ROS {base.version}, written from its topics.",
        "licence: LicenseRef-own",
        f"extends: generic-ros{base.version}",
        "",
        "driver:",
        f"  params: {{ {flow}, watchdog: none{stamped}{navigation} }}",
        *_overrides(base, has),
        *_page(has, has_map),
    ]
    return "\n".join(lines) + "\n"


def _overrides(base: BaseProfile, has: set[str]) -> list[str]:
    """Return the changes to the driver: parts that the robot lacks."""
    lines = []
    lacks = [name for name in _TESTS if name not in has]
    # An empty topic switches a message off, and the settings page can name the topic later.
    settings = [f'      {name}: {{ default: "" }}' for name in lacks]
    if base.via == "zenoh":
        settings.append("      bridge: { choices: [auto, rosbridge, foxglove, zenoh] }")
    if settings:
        lines += ["    settings:", *settings]
    tests = [test for name in lacks for test in _TESTS[name]]
    if base.is_stamped:
        tests.append("a drive is a Twist")
    if tests:
        lines.append("    tests:")
        lines += [f'      - {{ name: "{name}", remove: true }}' for name in tests]
    return ["  overrides:", *lines] if lines else []


def _page(has: set[str], has_map: bool) -> list[str]:
    """Return the page: the picture or the map in the background, and the parts around the stick."""
    place = "floor" if has_map else "map"
    background = "camera" if "camera" in has else place
    top = ["battery" if "battery" in has else ".", "speed", ".", "laser" if "scan" in has else "."]
    low = ["stick", ".", ".", place if background == "camera" else "."]
    if "imu" in has:
        low[2] = "attitude"
    return [
        "",
        "interfaces:",
        "  default:",
        f"    background: {background}",
        "    grid: |",
        *(f"      {'  '.join(row)}" for row in (top, [".", ".", ".", "."], low)),
    ]

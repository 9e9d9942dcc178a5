"""List the topics of a ROS robot, and write the YAML that declares them."""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from urc.model.values import NOTHING
from urc.runtime.ros_survey import list_topics
from urc.transports.base import Transport

__all__ = ["RosTopic", "ros_topics", "snippet"]

_FIELDS: Mapping[str, Mapping[str, tuple[str, str]]] = {
    # Type → signal → place in the message, and unit: common_interfaces, REP-103.
    "sensor_msgs/BatteryState": {"voltage": ("voltage", "V"), "charge": ("percentage", "")},
    "nav_msgs/Odometry": {
        "x": ("pose.pose.position.x", "m"),
        "y": ("pose.pose.position.y", "m"),
        "speed": ("twist.twist.linear.x", "m/s"),
        "turn": ("twist.twist.angular.z", "rad/s"),
    },
    "geometry_msgs/Twist": {"speed": ("linear.x", "m/s"), "turn": ("angular.z", "rad/s")},
    "sensor_msgs/NavSatFix": {"latitude": ("latitude", "deg"), "longitude": ("longitude", "deg")},
    "sensor_msgs/Range": {"range": ("range", "m")},
    "sensor_msgs/Temperature": {"temperature": ("temperature", "degC")},
}
_NAME = re.compile(r"[A-Za-z0-9_/~]+")
_PLAIN = re.compile(r"std_msgs/(?:msg/)?(?:Bool|String|Float\d+|U?Int\d+)")


class RosTopic(NamedTuple):
    """A topic of the robot that has at least one publisher or subscriber."""

    name: str
    type: str
    """Message type; "" if unknown."""


async def ros_topics(transport: Transport, timeout_s: float) -> list[RosTopic]:
    """Open a ROS transport, list all topics, and close the transport.

    Raises:
        TransportError: the robot does not respond, or its topics cannot be listed.
    """
    try:
        await transport.open(timeout_s)
        found = await list_topics(transport)
    finally:
        await transport.close()
    types = {row.name: (row.carries or row.takes or ("",))[0] for row in found.rows}
    return sorted(RosTopic(name, kind) for name, kind in types.items())


def snippet(topics: Sequence[RosTopic], transport: str) -> str:
    """Return signals and messages in YAML for all topics with known fields."""
    signals: list[str] = []
    messages: list[str] = []
    for topic in topics:
        fields = _fields_of(topic)
        if not fields:
            continue
        stem = re.sub(r"[^a-z0-9]+", "_", topic.name.lower()).strip("_") or "topic"
        stem = stem if stem[0].isalpha() else f"t_{stem}"
        named = {f"{stem}_{name}" if name else stem: place for name, place in fields.items()}
        signals += [_signal(topic, name, unit) for name, (_, unit) in named.items()]
        paths = ", ".join(f"{name}: {path}" for name, (path, _) in named.items())
        messages += [
            f"  {stem}:",
            f"    from: {transport}",
            f'    subscribe: {{ topic: "{topic.name}", type: {topic.type}, throttle: 100ms }}',
            f"    json: {{ {paths} }}",
        ]
    if not signals:
        return ""
    return "\n".join(("signals:", *signals, "", "messages:", *messages))


def _fields_of(topic: RosTopic) -> Mapping[str, tuple[str, str]]:
    if not _NAME.fullmatch(topic.name):
        return NOTHING  # not a valid ROS name, so not for a document
    if _PLAIN.fullmatch(topic.type):
        return {"": ("data", "")}
    return _FIELDS.get(topic.type.replace("/msg/", "/"), NOTHING)


def _signal(topic: RosTopic, name: str, unit: str) -> str:
    kind = topic.type.rpartition("/")[2]
    if kind == "String":
        return f"  {name}: {{ type: string }}"
    if kind == "Bool":
        return f"  {name}: {{ type: boolean }}"
    if "Int" in kind:
        return f"  {name}: {{ type: integer }}"
    return f"  {name}: {{ unit: {unit} }}" if unit else f"  {name}: {{}}"

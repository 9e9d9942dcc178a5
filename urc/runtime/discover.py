"""List the topics of a robot behind rosbridge, and write the YAML that declares them."""

import asyncio
import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from urc.model.payload import Envelope
from urc.model.values import NOTHING
from urc.transports.base import Transport, TransportError

__all__ = ["RosTopic", "ros_topics", "snippet"]

ANSWER_S = 5.0

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
    """Message type; "" if unknown to rosapi."""


async def ros_topics(transport: Transport, timeout_s: float) -> list[RosTopic]:
    """Open the rosbridge transport, ask rosapi for all topics, and close the transport.

    Raises:
        TransportError: the bridge or rosapi does not respond, or the reply contains no topics.
    """
    try:
        await transport.open(timeout_s)
        await transport.send(Envelope("call", {"service": "/rosapi/topics", "id": 1}, {}))
        async with asyncio.timeout(ANSWER_S):
            while True:
                said = await transport.receive()
                if isinstance(said, Envelope) and said.verb == "response":
                    break
    except TimeoutError:
        text = f"{transport.address}: rosapi has not replied within {ANSWER_S:g} s; is it running?"
        raise TransportError(text) from None
    finally:
        await transport.close()
    if said.attributes.get("ok") is not True:
        raise TransportError(
            f"{transport.address}: rosapi is not available ({said.attributes.get('reason')})"
        )
    values = said.body if isinstance(said.body, Mapping) else NOTHING
    names, types = values.get("topics"), values.get("types")
    if not isinstance(names, list) or not isinstance(types, list):
        raise TransportError(f"{transport.address}: the reply from rosapi contains no topics")
    types += [""] * (len(names) - len(types))
    return sorted(RosTopic(str(name), str(kind)) for name, kind in zip(names, types, strict=False))


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

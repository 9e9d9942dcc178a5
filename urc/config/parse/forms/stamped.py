"""The key ``stamped`` of a published ROS message and of a test's expected message.

The parser itself converts the message to its stamped type, so the engine needs no special case.
"""

from typing import Final

from urc.config.node import Node, Problems

__all__ = ["stamped_body", "stamped_type"]

_FIELDS: Final = {
    "Accel": "accel",
    "AccelWithCovariance": "accel",
    "Inertia": "inertia",
    "Point": "point",
    "Polygon": "polygon",
    "Pose": "pose",
    "PoseWithCovariance": "pose",
    "Quaternion": "quaternion",
    "Twist": "twist",
    "TwistWithCovariance": "twist",
    "Vector3": "vector",
    "Wrench": "wrench",
}
"""Value field of each stamped geometry_msgs type, by plain type (ROS common_interfaces)."""


def stamped_type(part: Node, kind: object, problems: Problems) -> str | None:
    """Return the stamped type of the plain type `kind`, such as ``geometry_msgs/TwistStamped``.

    Args:
        part: the message, which has the key ``stamped``.
        kind: the message's type.
        problems: receives a problem if `kind` has no known stamped type; the result is then None.
    """
    package, _, name = str(kind).replace("/msg/", "/").partition("/")
    if package == "geometry_msgs" and name in _FIELDS and "json" in part.data:
        return f"{kind}Stamped"
    problems.error(
        part,
        "bad-value",
        f"{kind!r} has no known stamped type, or 'json' is missing",
        at="stamped",
        hint=f"use 'json' with one of the geometry_msgs types {', '.join(_FIELDS)};"
        " write other messages in full",
    )
    return None


def stamped_body(kind: str, body: object) -> dict[str, object]:
    """Return the body of a stamped message; rosbridge replaces ``now`` with the current time.

    Args:
        kind: the stamped type, from `stamped_type`.
        body: body of the plain message.
    """
    field = _FIELDS[kind.rpartition("/")[2].removesuffix("Stamped")]
    return {"header": {"stamp": "now", "frame_id": ""}, field: body}

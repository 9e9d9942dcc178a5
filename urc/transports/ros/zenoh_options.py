"""The options of a ROS 2 system on Zenoh.

This module needs no Zenoh library.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

from urc.key_expressions import key_fault
from urc.transports.base import TransportError, TransportSetup
from urc.transports.ros.robot_time import CLOCK_TOPIC, CLOCK_TYPE
from urc.transports.zenoh_options import ZenohOptions, read_options

__all__ = ["DISTROS", "Ros2Options", "Ros2Topic", "read_ros_options"]

DISTROS: Final = ("humble", "jazzy", "kilted", "lyrical", "rolling")
"""Versions of ROS 2 with rmw_zenoh."""
MAX_DOMAIN: Final = 232


class Ros2Topic(NamedTuple):
    """A topic that the driver uses."""

    topic: str
    type: str = ""
    throttle_s: float = 0.0
    hashed: str = ""
    """Hash of the type, if URC knows the type."""


class Ros2Options(NamedTuple):
    """All options of one transport."""

    zenoh: ZenohOptions
    topics: tuple[Ros2Topic, ...] = ()
    domain: int = 0
    has_hashes: bool = True
    """Whether keys contain the hashes of types; False for ROS 2 Humble."""
    clock_only: bool | None = None
    """None for the robot's own time. Otherwise, the time is that of the topic ``/clock``, and true
    means that the driver does not read this topic."""


def read_ros_options(setup: TransportSetup) -> Ros2Options:
    """Return the options of `setup`; raise `TransportError` for an invalid option."""
    zenoh = read_options(setup._replace(subscriptions=()))
    given = setup.options.get("ros2") or {}
    if not isinstance(given, Mapping):
        raise TransportError(f"ros needs domain and distro as ros2, not {given!r}")
    domain = given.get("domain", 0)
    if isinstance(domain, bool) or not isinstance(domain, int) or not 0 <= domain <= MAX_DOMAIN:
        raise TransportError(f"ros needs 0 to {MAX_DOMAIN} as ros2.domain, not {domain!r}")
    distro = given.get("distro", "jazzy")
    if distro not in DISTROS:
        raise TransportError(f"ros needs {', '.join(DISTROS)} as ros2.distro, not {distro!r}")
    topics = []
    for one in setup.subscriptions:
        fault = key_fault(one.topic.strip("/"))
        if fault:
            raise TransportError(f"ros needs a topic name, not {one.topic!r}: {fault}")
        said = one.attributes
        throttle = said.get("throttle", 0.0)
        throttle_s = float(throttle) if isinstance(throttle, int | float) else 0.0
        kind, hashed = str(said.get("type") or ""), str(said.get("hash") or "")
        topics.append(Ros2Topic(one.topic, kind, throttle_s, hashed))
    clock_only = None
    if setup.options.get("use_sim_time") is True:
        clock_only = all(one.topic != CLOCK_TOPIC for one in topics)
        topics += [Ros2Topic(CLOCK_TOPIC, CLOCK_TYPE)] if clock_only else []
    return Ros2Options(zenoh, tuple(topics), domain, distro != "humble", clock_only)

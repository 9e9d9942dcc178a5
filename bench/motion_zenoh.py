"""Data that a driven robot received after its Zenoh router was frozen or killed.

The robot is a device with keys, or a ROS 2 robot with topics that URC throttles.
"""

from collections.abc import Sequence

from bench.harness import Result
from bench.troubles import trouble

__all__ = ["run"]


def run(*, full: bool) -> Sequence[Result]:
    """Freeze and kill servers; compare the received data with the limits."""
    return [*trouble("zenoh", full=full), *trouble("ros_zenoh", full=full)]

"""The factory for the transport to a ROS 2 system on Zenoh.

This module does not import the Zenoh library itself, so that it can report a missing library.
"""

from importlib.util import find_spec

from urc._extras import missing
from urc.transports._stream_dialer import StreamDialer
from urc.transports.base import MissingPackage, Transport, TransportSetup
from urc.transports.ros.zenoh_options import read_ros_options

__all__ = ["from_setup"]


def from_setup(setup: TransportSetup) -> Transport:
    """Return a transport for a document's options; see docs/transports/ros-zenoh.md.

    Raises:
        TransportError: an option is missing or invalid.
        MissingPackage: a library is not installed.
    """
    options = read_ros_options(setup)
    for package in ("zenoh", "xxhash"):
        if find_spec(package) is None:
            name = "eclipse-zenoh" if package == "zenoh" else package
            raise MissingPackage(missing("ros over zenoh needs", name, "zenoh"))
    from urc.transports.ros.zenoh_client import RosZenohTransport  # imports the library

    place = options.zenoh
    dialer = StreamDialer(place.host, place.port, tunnel=setup.tunnel, tls=place.tls)
    return RosZenohTransport(options, dialer)

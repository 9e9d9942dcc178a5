"""The factory for the camera transport, for cameras that send H.264 or H.265.

This module does not import the video library, which only the camera's own process uses, so that it
can report a missing library.
"""

from importlib.util import find_spec

from urc._extras import missing
from urc.transports.base import MissingPackage, Transport, TransportSetup
from urc.transports.camera_options import read_options

__all__ = ["from_setup", "missing_library"]


def from_setup(setup: TransportSetup) -> Transport:
    """Return a camera transport for a document's options; see docs/transports/camera.md.

    Raises:
        TransportError: an option is missing or invalid.
        MissingPackage: the library is not installed.
    """
    options = read_options(setup)
    if lack := missing_library():
        raise MissingPackage(lack)
    from urc.transports.camera_transport import CameraTransport

    return CameraTransport(options)


def missing_library() -> str:
    """Return a message that names the missing library and its command; "" if it is installed."""
    return missing("camera needs", "av", "video") if find_spec("av") is None else ""

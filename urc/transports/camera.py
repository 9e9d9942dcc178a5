"""The factory for the camera transport, for cameras that send H.264 or H.265.

This module does not import the video libraries, which only the camera's own process uses, so that
it can report a missing library.
"""

from importlib.util import find_spec

from urc._extras import missing
from urc.transports.base import MissingPackage, Transport, TransportSetup
from urc.transports.camera_options import read_low_options, read_options

__all__ = ["from_setup"]


def from_setup(setup: TransportSetup) -> Transport:
    """Return a camera transport for a document's options; see docs/transports/camera.md.

    Raises:
        TransportError: an option is missing or invalid.
        MissingPackage: the library is not installed.
    """
    options, low = read_options(setup), read_low_options(setup)
    schemes = {options.scheme, low.scheme if low is not None else options.scheme}
    if "whep" in schemes and find_spec("aiortc") is None:
        raise MissingPackage(missing("camera with WHEP needs", "aiortc", "whep"))
    if find_spec("av") is None:
        raise MissingPackage(missing("camera needs", "av", "video"))
    from urc.transports.camera_transport import CameraTransport

    if low is None:
        return CameraTransport(options)
    from urc.transports.camera_streams import TwoStreamCamera

    return TwoStreamCamera(CameraTransport(options), CameraTransport(low))

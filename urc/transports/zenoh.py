"""The factory for the Zenoh transport, for devices with Zenoh keys.

This module does not import the Zenoh library itself, so that it can report a missing library.
"""

from importlib.util import find_spec

from urc._extras import missing
from urc.transports._stream_dialer import StreamDialer
from urc.transports.base import MissingPackage, Transport, TransportSetup
from urc.transports.zenoh_options import read_options

__all__ = ["from_setup"]


def from_setup(setup: TransportSetup) -> Transport:
    """Return a Zenoh transport for a document's options; see docs/transports/zenoh.md.

    Raises:
        TransportError: an option is missing or invalid.
        MissingPackage: the library is not installed.
    """
    options = read_options(setup)
    if find_spec("zenoh") is None:
        raise MissingPackage(missing("zenoh needs", "eclipse-zenoh", "zenoh"))
    from urc.transports.zenoh_client import ZenohTransport  # imports the library

    dialer = StreamDialer(options.host, options.port, tunnel=setup.tunnel, tls=options.tls)
    return ZenohTransport(options, dialer)

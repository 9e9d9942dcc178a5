"""The factory for the MQTT transport, for robots behind an MQTT broker.

This module does not import the MQTT library itself, so that it can report a missing library.
"""

from importlib.util import find_spec

from urc._extras import missing
from urc.transports.base import MissingPackage, Transport, TransportSetup
from urc.transports.mqtt_options import read_options
from urc.transports.web_dial import Dialer
from urc.transports.web_origin import WebOrigin

__all__ = ["from_setup"]


def from_setup(setup: TransportSetup) -> Transport:
    """Return an MQTT transport for a document's options; see docs/transports/mqtt.md.

    Raises:
        TransportError: an option is missing or invalid.
        MissingPackage: the library is not installed.
    """
    options = read_options(setup)
    if find_spec("paho") is None:
        raise MissingPackage(missing("mqtt needs", "paho-mqtt", "mqtt"))
    from urc.transports.mqtt_client import MqttTransport  # imports paho

    place = WebOrigin(options.tls is not None, options.host, options.port, "")
    return MqttTransport(options, Dialer(place, tls=options.tls, tunnel=setup.tunnel))

"""Robots that talk through an MQTT broker: the door to the transport.

It needs no MQTT library, so that a document that names one is told what is missing.
"""

from importlib.util import find_spec

from urc.transports.base import Setup, Transport, TransportError
from urc.transports.mqtt_options import read_options
from urc.transports.web_dial import Dialer
from urc.transports.web_place import WebPlace

__all__ = ["from_setup"]


def from_setup(setup: Setup) -> Transport:
    """Make a transport out of a document's options; see docs/transports/mqtt.md.

    Raises:
        TransportError: an option is missing or not usable, or the library is not there.
    """
    options = read_options(setup)
    if find_spec("paho") is None:
        raise TransportError("mqtt needs the package paho-mqtt: pip install 'urc[mqtt]'")
    from urc.transports.mqtt_client import MqttTransport  # imports paho

    place = WebPlace(options.tls is not None, options.host, options.port, "")
    return MqttTransport(options, Dialer(place, tls=options.tls, via=setup.via))

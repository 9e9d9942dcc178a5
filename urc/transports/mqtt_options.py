"""An MQTT transport's options.

This module needs no MQTT library.
"""

from collections.abc import Mapping
from typing import NamedTuple

from urc.transports import _options
from urc.transports._faults import place_of
from urc.transports._tls import Tls
from urc.transports.base import TransportError, TransportSetup

__all__ = ["MqttOptions", "MqttTopic", "WillMessage", "read_options"]

DEFAULT_PORT, DEFAULT_TLS_PORT = 1883, 8883


class MqttTopic(NamedTuple):
    """One subscription."""

    topic: str
    qos: int = 0


class WillMessage(NamedTuple):
    """The will: a message that the broker publishes when the connection ends."""

    topic: str
    payload: bytes
    qos: int = 0
    retain: bool = False


class MqttOptions(NamedTuple):
    """All options of one MQTT transport."""

    host: str
    port: int
    is_v5: bool = True
    """Whether to use MQTT 5 instead of 3.1.1."""
    client_id: str = ""
    """Client ID; "" to let the library generate an ID."""
    username: str = ""
    password: str | None = None
    tls: Tls | None = None
    will: WillMessage | None = None
    subscriptions: tuple[MqttTopic, ...] = ()

    @property
    def where(self) -> str:
        """Host and port as ``HOST:PORT``, with brackets around an IPv6 address."""
        return place_of(self.host, self.port)


def read_options(setup: TransportSetup) -> MqttOptions:
    """Return the options of `setup`; raise `TransportError` for an invalid option."""
    given: Mapping[str, object] = setup.options
    tls = Tls.of("mqtt", given.get("tls"))
    port = DEFAULT_TLS_PORT if tls is not None else DEFAULT_PORT
    username = _options.text("mqtt", given, "username")
    password = _options.text("mqtt", given, "password")
    if password and not username:
        raise TransportError("mqtt has a password but no username")
    version = str(given.get("version", 5))
    if version not in ("5", "3.1.1"):
        raise TransportError(f"mqtt: version must be 5 or 3.1.1, not {version!r}")
    return MqttOptions(
        _options.host("mqtt", given),
        _options.port("mqtt", {"port": port, **given}),
        version == "5",
        _options.text("mqtt", given, "client_id"),
        username,
        password or None,
        tls,
        _will(given.get("will")),
        tuple(MqttTopic(one.topic, _qos("qos", one.attributes)) for one in setup.subscriptions),
    )


def _will(given: object) -> WillMessage | None:
    if given is None:
        return None
    if not isinstance(given, Mapping):
        raise TransportError(f"mqtt: will must be a mapping with topic and payload, not {given!r}")
    topic = _options.text("mqtt", given, "topic")
    if not topic or "+" in topic or "#" in topic:
        raise TransportError(f"mqtt: will.topic must be one topic without wildcards, not {topic!r}")
    payload = _options.text("mqtt", given, "payload").encode()
    retain = _options.flag("mqtt", given, "retain", default=False)
    return WillMessage(topic, payload, _qos("qos", given), retain)


def _qos(name: str, given: Mapping[str, object]) -> int:
    value = given.get(name, 0)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= 2:
        raise TransportError(f"mqtt: {name} must be 0, 1 or 2, not {value!r}")
    return value

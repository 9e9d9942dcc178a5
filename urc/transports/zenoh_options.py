"""A Zenoh transport's options.

This module needs no Zenoh library.
"""

from collections.abc import Mapping
from typing import NamedTuple

from urc.key_expressions import key_fault
from urc.transports import _options
from urc.transports._faults import one_line, place_of
from urc.transports._tls import Tls
from urc.transports.base import TransportError, TransportSetup

__all__ = ["DEFAULT_PORT", "KeySubscription", "ZenohOptions", "read_options"]

DEFAULT_PORT = 7447


class KeySubscription(NamedTuple):
    """One subscription to values or to liveliness tokens."""

    topic: str
    """Key expression."""
    is_liveliness: bool = False
    """Whether to watch the liveliness tokens of these keys, instead of their values."""


class ZenohOptions(NamedTuple):
    """All options of one transport."""

    host: str
    port: int
    username: str = ""
    password: str = ""
    tls: Tls | None = None
    liveliness: str = ""
    """Key of URC's own liveliness token; "" for no token."""
    subscriptions: tuple[KeySubscription, ...] = ()

    @property
    def where(self) -> str:
        """Host and port as ``HOST:PORT``, with brackets around an IPv6 address."""
        return place_of(self.host, self.port)


def read_options(setup: TransportSetup) -> ZenohOptions:
    """Return the options of `setup`; raise `TransportError` for an invalid option."""
    given: Mapping[str, object] = setup.options
    username = _options.text("zenoh", given, "username")
    password = _options.text("zenoh", given, "password")
    if bool(username) != bool(password):
        raise TransportError("zenoh needs both username and password, or neither")
    liveliness = _options.text("zenoh", given, "liveliness")
    if liveliness and (fault := key_fault(liveliness)):
        raise TransportError(
            f"zenoh needs a key as liveliness, not {one_line(liveliness)!r}: {fault}"
        )
    return ZenohOptions(
        _options.host("zenoh", given),
        _options.port("zenoh", {"port": DEFAULT_PORT, **given}),
        username,
        password,
        Tls.of("zenoh", given.get("tls")),
        liveliness,
        tuple(_subscription(one.topic, one.attributes) for one in setup.subscriptions),
    )


def _subscription(topic: str, attributes: Mapping[str, object]) -> KeySubscription:
    if fault := key_fault(topic, is_expression=True):
        raise TransportError(
            f"zenoh needs a key expression as topic, not {one_line(topic)!r}: {fault}"
        )
    return KeySubscription(topic, _options.flag("zenoh", attributes, "liveliness", default=False))

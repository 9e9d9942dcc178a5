"""A short digest of a robot's network destinations, used to bind secrets to these destinations.

Secrets are sent to the hosts named in the transport options. Each secret is therefore stored with
its destination and is never used for a different destination.
"""

import json
from collections.abc import Mapping
from hashlib import sha256
from typing import Any, Final

from urc.expressions import ExpressionError
from urc.model.driver import TransportSpec
from urc.model.profile import Profile
from urc.model.values import Value
from urc.protocol.forms.json_text import filled

__all__ = ["destination_of"]

_MANNERS: Final = frozenset(
    (
        *("username", "password", "key", "passphrase", "agent", "auth", "headers", "client_id"),
        *("baud", "data_bits", "parity", "stop_bits", "flow_control", "rts", "dtr", "exclusive"),
        *("version", "will", "probe", "response_timeout", "in_flight", "max_body"),
        *("subprotocols", "send_as", "ping_interval", "ping_timeout", "max_message", "pty"),
        *("environment", "legacy", "keepalive_interval", "negotiate", "echo", "binary", "terminal"),
        "replies",
    )
)
"""Transport options that do not affect the destination. All other options, including those of
third-party transports, are part of the destination."""


def destination_of(profile: Profile, package: str, values: Mapping[str, Value]) -> str:
    """Return a digest of a robot's destinations with the given settings.

    Two versions of a package have the same digest if their transports and destinations are the
    same.

    Args:
        profile: profile with the transports.
        package: package name, such as ``drivers/puppet``; "" for a document given by path.
        values: value of each setting, by name.
    """
    empty = {name: one.empty for name, one in profile.settings.items() if not one.is_required}
    lines = [_line(spec, empty | dict(values)) for spec in profile.driver.transports.values()]
    # Robots behind a gateway are named in sent data, not in an option.
    named = [
        [name, values.get(name)]
        for name, setting in profile.settings.items()
        if setting.type in ("host", "port")
    ]
    text = json.dumps([package, sorted(lines, key=str), sorted(named, key=str)], default=str)
    return sha256(text.encode()).hexdigest()


def _line(spec: TransportSpec, values: Mapping[str, Value]) -> list[Any]:
    places = [
        [name, _filled(option, values)]
        for name, option in sorted(spec.options.items())
        if name not in _MANNERS
    ]
    return [spec.name, spec.type, spec.tunnel, places]


def _filled(option: object, values: Mapping[str, Value]) -> object:
    try:
        return filled(option, {"settings": values})
    except ExpressionError:
        return None  # it needs a missing setting, so no data goes there

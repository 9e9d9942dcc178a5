"""The destination of a robot's transports, as one short text; secrets are bound to it.

A secret goes to any host that the transports' options name. So each secret is stored together with
the destination for which it was entered, and is never used for another one.
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
"""Options about the manner of the connection. All others count as a place, also those of a
transport that does not ship with URC."""


def destination_of(profile: Profile, package: str, values: Mapping[str, Value]) -> str:
    """Return a digest of all places that a robot's settings can reach.

    Equal packages with equal transports and places have equal digests.

    Args:
        profile: profile with the transports.
        package: ``drivers/puppet``; "" for a document given by path.
        values: values of the settings.
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

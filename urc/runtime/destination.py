"""Where a robot's lines lead, as one short text: what is entered as a secret is for there alone.

A secret goes to whatever the options of the transports name. So each is kept with the destination
for which it was entered, and is not used for another one.
"""

import json
from collections.abc import Mapping
from hashlib import sha256
from typing import Any, Final

from urc.expressions import ExpressionError
from urc.model.driver import TransportSpec
from urc.model.profile import Profile
from urc.model.values import Value
from urc.protocol.json_text_form import filled

__all__ = ["destination_of"]

_MANNERS: Final = frozenset(
    (
        *("username", "password", "key", "passphrase", "agent", "auth", "headers", "client_id"),
        *("baud", "data_bits", "parity", "stop_bits", "flow_control", "rts", "dtr", "exclusive"),
        *("ros", "version", "will", "probe", "answer_timeout", "in_flight", "max_body"),
        *("subprotocols", "send_as", "ping_every", "ping_timeout", "max_message", "pty"),
        *("environment", "legacy", "alive_every", "negotiate", "echo", "binary", "terminal"),
        "answers",
    )
)
"""Options that say how to talk there. Any other one, as of a transport that does not ship with URC,
counts as a place."""


def destination_of(profile: Profile, package: str, values: Mapping[str, Value]) -> str:
    """Return a digest of all places to which a robot's settings can go.

    Two are equal where the package, its transports and their places are the same.

    Args:
        profile: whose transports.
        package: ``drivers/puppet``; "" for a document that was named at the start.
        values: of the settings.
    """
    empty = {name: one.empty for name, one in profile.settings.items() if not one.is_required}
    lines = [_line(spec, empty | dict(values)) for spec in profile.driver.transports.values()]
    # Robots behind a gateway are named in what is sent, not in an option.
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
    return [spec.name, spec.type, spec.via, places]


def _filled(option: object, values: Mapping[str, Value]) -> object:
    try:
        return filled(option, {"settings": values})
    except ExpressionError:
        return None  # it needs what is not set yet: nothing goes there

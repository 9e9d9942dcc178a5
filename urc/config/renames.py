"""Tables of renamed keys, values and problem codes.

`urc migrate`, `urc explain` and the hints for unknown keys use these tables. The language accepts
only the new names. This module imports no other module of URC.
"""

import re
from collections.abc import Mapping
from typing import Any, Final, Literal, NamedTuple

__all__ = [
    "CODES",
    "KEYS",
    "VALUES",
    "KeyRename",
    "ValueRename",
    "renamed_hint",
    "renamed_value_hint",
]

Content = Literal["driver", "interface", "widget", "demo"]
"""Kind of a document or part of a document; a robot contains a driver and interfaces."""

_TRANSPORT: Final = "transports/[^/]+"
_ARRAY: Final = "signals/[^/]+|commands/[^/]+/args/[^/]+"
_TEST: Final = "tests/[^/]+(?:/steps/[^/]+)?"
_PAGE: Final = "(?:tabs/[^/]+)?"
_SCREENS: Final = "(?:tabs/[^/]+/)?(?:grids|layouts|left|left_handed)"
_CAMERA: Final = "simulator/world/camera"
_INPUT: Final = "inputs/[^/]+"
_OPTION: Final = "options/[^/]+(?:/items|/additionalProperties)*"
_DEMO: Final = "signals/[^/]+|outputs/[^/]+/arguments/[^/]+"


class KeyRename(NamedTuple):
    """A renamed key."""

    content: Content
    place: str
    """Pattern for the path to the mapping that contains the key, with slashes as separators."""
    old: str
    new: str
    types: tuple[str, ...] = ()
    """The rename affects only mappings whose `type` is in this tuple; () means all mappings.

    Mappings without `type` are always affected.
    """

    def applies(self, mapping: Mapping[str, Any]) -> bool:
        """Return whether `mapping` contains the old key and is affected by the rename."""
        if self.old not in mapping:
            return False
        kind = mapping.get("type")
        if self.old == "via":  # `via` of a ROS transport is a new key with another meaning
            bridges = ("rosbridge", "foxglove", "auto", "zenoh")
            return kind != "ros" and (kind is not None or mapping["via"] not in bridges)
        return not self.types or kind is None or kind in self.types


class ValueRename(NamedTuple):
    """A renamed value of a key."""

    content: Content
    place: str
    key: str
    old: str
    new: str


KEYS: Final = (
    KeyRename("interface", _PAGE, "grids", "layouts"),
    KeyRename("interface", _PAGE, "left", "left_handed"),
    KeyRename("interface", _SCREENS, "wide", "landscape"),
    KeyRename("interface", _SCREENS, "tall", "portrait"),
    KeyRename("interface", _SCREENS, "phone", "phone_portrait"),
    KeyRename("interface", _SCREENS, "low", "phone_landscape"),
    KeyRename("driver", _TRANSPORT, "via", "tunnel"),
    KeyRename("driver", _TRANSPORT, "ros", "version", ("rosbridge", "ros")),
    KeyRename("driver", _TRANSPORT, "answers", "replies"),
    KeyRename("driver", _TRANSPORT, "answer_timeout", "response_timeout", ("http",)),
    KeyRename("driver", _TRANSPORT, "alive_every", "keepalive_interval", ("ssh",)),
    KeyRename("driver", _TRANSPORT, "ping_every", "ping_interval", ("websocket",)),
    KeyRename("driver", "messages/[^/]+", "answer", "acknowledge"),
    KeyRename("driver", "messages/[^/]+/collect/[^/]+", "most", "max"),
    KeyRename("driver", _ARRAY, "of", "items"),
    KeyRename("driver", "simulator/world", "plan", "map"),
    KeyRename("driver", _CAMERA, "view", "fov"),
    KeyRename("driver", _CAMERA, "up", "mount_height"),
    KeyRename("widget", "", "needs", "at_least_one_of"),
    KeyRename("widget", "", "together", "required_together"),
    KeyRename("widget", "", "gate", "dead_man"),
    KeyRename("widget", _INPUT, "of", "items"),
    KeyRename("widget", _INPUT, "each", "keep_all"),
    KeyRename("widget", _INPUT, "many", "multiple"),
    KeyRename("widget", _INPUT, "instead_of", "replaces"),
    KeyRename("widget", _OPTION, "below", "less_than"),
    KeyRename("widget", _OPTION, "gives", "argument_of"),
    KeyRename("widget", _OPTION, "local", "same_origin"),
    KeyRename("demo", _DEMO, "of", "items"),
)

VALUES: Final = (
    ValueRename("driver", _TRANSPORT, "type", "rosbridge", "ros"),
    ValueRename("driver", _TEST, "fails", "silent", "no-data"),
)

CODES: Final = {
    "eager-retry": "retry-too-early",
    "hasty-verify": "verify-too-early",
    "held-back": "hold-rate-limited",
    "impatient-poll": "short-poll-timeout",
    "long-good-bye": "long-on-close",
    "never-answers": "never-replies",
    "other-name": "name-mismatch",
    "sent-again": "retransmitted",
    "silent": "no-data",
    "steps-pile-up": "step-backlog",
    "unlike-values": "incompatible-values",
    "unnoticed-freeze": "no-liveness-check",
    "unnoticed-loss": "no-loss-detection",
}
"""New problem codes, by old code."""


def renamed_hint(path: tuple[str | int, ...], key: str, known: Mapping[str, Any]) -> str:
    """Return a hint for an old key in the mapping at `path`; "" for other keys."""
    where = "/".join(map(str, path))
    for one in KEYS:
        if one.old != key or one.new not in known:
            continue
        if re.search(f"(?:^|/)(?:{one.place})$", where):
            return f"the new name is '{one.new}'; 'urc migrate' replaces old names"
    return ""


def renamed_value_hint(key: str, value: str) -> str:
    """Return a hint for an old value; "" for other values."""
    for one in VALUES:
        if (one.key, one.old) == (key, value):
            return f"the new name is '{one.new}'; 'urc migrate' replaces old names"
    return ""

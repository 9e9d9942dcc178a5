"""Parser for a driver's transports: mapping → `TransportSpec`."""

from collections.abc import Iterator
from typing import Final

from urc.config.node import Node, Problems
from urc.config.parse.camera import check_camera
from urc.config.parse.forms.json_text import compiled_tree, placed_templates
from urc.config.parse.framing import parse_framing
from urc.config.parse.headers import check_headers
from urc.config.renames import renamed_value_hint
from urc.config.spelling_suggestions import did_you_mean
from urc.expressions import Template
from urc.model.driver import Backoff, FramingSpec, Timeouts, TransportSpec
from urc.registry import Registries

__all__ = ["option_templates", "parse_transport"]

_COMMON: Final = (
    "type", "connection", "framing", "send_framing", "encoding", "timeouts", "reconnect", "min_gap",
    "queue", "keepalive", "on_connect", "on_close", "stale_after", "tunnel",
    "replies", "duplex", "errors", "hint",
)  # fmt: skip


_OTHER_WORDS = {
    "socket": "tcp",
    "tcpip": "tcp",
    "ip": "tcp",
    "ethernet": "tcp",
    "usb": "serial",
    "uart": "serial",
    "rs232": "serial",
    "com": "serial",
    "rest": "http",
    "https": "http",
    "ws": "websocket",
    "ros2": "ros",
    "roslibjs": "ros",
    "rtsp": "camera",
    "whep": "camera",
    "webrtc": "camera",
    "video": "camera",
    "webcam": "camera",
}
"""Transport types, keyed by the word that other programs use."""


def _other_word(word: str) -> str:
    """Return a hint that names the type for another program's word; "" for an unknown word."""
    other = _OTHER_WORDS.get(word.lower())
    return f"use the word '{other}'" if other else ""


def parse_transport(part: Node, problems: Problems, catalog: Registries) -> TransportSpec:
    """Return the transport at `part`; report mistakes in the declaration."""
    kind = part.must("type")
    if catalog.transports.get(kind.data) is None:
        problems.error(
            kind,
            "unknown-transport-type",
            f"there is no transport of type {kind.data!r}",
            hint=renamed_value_hint("type", kind.data)
            or _other_word(kind.data)
            or did_you_mean(kind.data, catalog.transports, "types"),
        )
    check_headers(part, problems)
    check_camera(part, problems)
    encoding = part.text("encoding", "utf-8")
    options = {
        name: _option(inner, problems)
        for name, inner in part.entries().items()
        if name not in _COMMON
    }
    persistent = part.text("connection", "persistent") == "persistent"
    return TransportSpec(
        name=part.name,
        type=kind.data,
        options=options,
        connection="persistent" if persistent else "per_request",
        framing=_framing(part, encoding, problems, catalog),
        encoding=encoding,
        timeouts=_timeouts(part.get("timeouts"), problems),
        backoff=_backoff(part.get("reconnect"), problems),
        min_gap_s=problems.duration(part, "min_gap", 0.0, least=0.0, most=3600),
        tunnel=part.text("tunnel"),
        is_half_duplex=part.text("duplex") == "half",
        never_replies=part.text("replies") == "never",
        hint=part.text("hint"),
    )


def _framing(part: Node, encoding: str, problems: Problems, catalog: Registries) -> FramingSpec:
    """Return the framing for received frames, including any separate framing for sent frames."""
    own = part.get("framing")
    if own is None:
        return FramingSpec("datagram")  # the schema requires 'framing' for streams
    framing = parse_framing(own, encoding, problems, catalog)
    sent = part.get("send_framing")
    if sent is None:
        return framing
    return framing._replace(sent=parse_framing(sent, encoding, problems, catalog))


def _option(part: Node, problems: Problems) -> object:
    """Return an option as a scalar, a template, or a list or mapping of scalars and templates."""
    tree = compiled_tree(part, problems)
    if isinstance(tree, Template) and tree.is_constant:
        return tree.evaluate({})
    return tree


def _timeouts(part: Node | None, problems: Problems) -> Timeouts:
    if part is None:
        return Timeouts()
    return Timeouts(
        connect_s=problems.duration(part, "connect", 3.0, least=0.01, most=300),
        reply_s=problems.duration(part, "reply", 2.0, most=3600),
        idle_s=problems.duration(part, "idle", 0.0, least=0.01) or None,
        on_connect_s=problems.duration(part, "on_connect", 0.0, least=0.01, most=3600) or None,
    )


def _backoff(part: Node | None, problems: Problems) -> Backoff:
    if part is None:
        return Backoff()
    default = Backoff()
    initial = problems.duration(part, "initial", default.initial_s, least=0.01, most=3600)
    longest = problems.duration(part, "max", max(default.max_s, initial), least=0.01, most=3600)
    if initial > longest:
        problems.error(
            part,
            "wrong-order",
            "'initial' is longer than 'max'",
            at="initial",
            hint="'initial' is the first delay, and 'max' is the longest delay",
        )
    jitter = part.number("jitter")
    return Backoff(initial, longest, default.jitter if jitter is None else jitter)


def option_templates(part: Node, spec: TransportSpec) -> Iterator[tuple[Node, Template]]:
    """Yield every template in the options of the transport at `part`, with its position."""
    for name, tree in spec.options.items():
        yield from placed_templates(part.must(name), tree)

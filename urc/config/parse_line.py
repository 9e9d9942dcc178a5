"""Transports of a driver: mapping → `TransportSpec`, framing and delimiters included."""

import re
from typing import Final

from urc.config.part import Findings, Part
from urc.config.suggest import did_you_mean
from urc.expressions import Template
from urc.model.driver import Backoff, FramingSpec, ScalarOrTemplate, Timeouts, TransportSpec
from urc.registry import Catalog

__all__ = ["CONTROL_NAMES", "parse_transport"]

_COMMON: Final = (
    "type", "connection", "framing", "encoding", "timeouts", "reconnect", "min_gap",
)  # fmt: skip
_NAMES = (
    "NUL SOH STX ETX EOT ENQ ACK BEL BS TAB LF VT FF CR SO SI DLE DC1 DC2 DC3 DC4 NAK SYN ETB CAN"
    " EM SUB ESC FS GS RS US"
)
CONTROL_NAMES: Final = {name: bytes((place,)) for place, name in enumerate(_NAMES.split())} | {
    "HT": b"\t",
    "DEL": b"\x7f",
    "CRLF": b"\r\n",
}
"""Names of control characters that a delimiter may be written with."""
_HEX = re.compile(r"0x((?:[0-9A-Fa-f]{2})+)")
_BACKSLASH = re.compile(r"\\(?:x[0-9A-Fa-f]{2}|[abefnrtv0])")
_SPELT = {r"\r": "CR", r"\n": "LF", r"\t": "TAB", r"\0": "NUL", r"\e": "ESC", r"\x1b": "ESC"}


def parse_transport(part: Part, findings: Findings, catalog: Catalog) -> TransportSpec:
    """Return one transport."""
    kind = part.must("type")
    if catalog.transports.get(kind.data) is None:
        findings.error(
            kind,
            "unknown-transport-type",
            f"there is no transport of type {kind.data!r}",
            hint=did_you_mean(kind.data, catalog.transports, "types"),
        )
    encoding = part.text("encoding", "utf-8")
    options = {
        name: _option(inner, findings)
        for name, inner in part.entries().items()
        if name not in _COMMON
    }
    persistent = part.text("connection", "persistent") == "persistent"
    return TransportSpec(
        name=part.name,
        type=kind.data,
        options=options,
        connection="persistent" if persistent else "per_request",
        framing=_framing(part.must("framing"), encoding, findings, catalog),
        encoding=encoding,
        timeouts=_timeouts(part.get("timeouts"), findings),
        backoff=_backoff(part.get("reconnect"), findings),
        min_gap_s=findings.duration(part, "min_gap", 0.0, least=0.0, most=3600),
    )


def _option(part: Part, findings: Findings) -> ScalarOrTemplate:
    if not isinstance(part.data, str):
        value: ScalarOrTemplate = part.data
        return value
    template = findings.template(part)
    if template is None or not template.is_constant:
        return template
    constant: ScalarOrTemplate = template.evaluate({})
    return constant


def _timeouts(part: Part | None, findings: Findings) -> Timeouts:
    if part is None:
        return Timeouts()
    return Timeouts(
        connect_s=findings.duration(part, "connect", 3.0, least=0.01, most=300),
        reply_s=findings.duration(part, "reply", 2.0, most=3600),
        idle_s=findings.duration(part, "idle", 0.0, least=0.01) or None,
    )


def _backoff(part: Part | None, findings: Findings) -> Backoff:
    if part is None:
        return Backoff()
    default = Backoff()
    initial = findings.duration(part, "initial", default.initial_s, least=0.01, most=3600)
    longest = findings.duration(part, "max", max(default.max_s, initial), least=0.01, most=3600)
    if initial > longest:
        findings.error(
            part,
            "wrong-order",
            "the first wait is longer than the longest one",
            at="initial",
            hint="'initial' is the first wait, 'max' the longest",
        )
    jitter = part.number("jitter")
    return Backoff(initial, longest, default.jitter if jitter is None else jitter)


def _framing(part: Part, encoding: str, findings: Findings, catalog: Catalog) -> FramingSpec:
    kind = part.must("type")
    longest = part.integer("max") or FramingSpec().max_bytes
    if catalog.framings.get(kind.data) is None:
        findings.error(
            kind,
            "unknown-framing",
            f"there is no framing of type {kind.data!r}",
            hint=did_you_mean(kind.data, catalog.framings, "types"),
        )
        return FramingSpec(max_bytes=longest)
    if kind.data != "delimiter":
        options = {name: item for name, item in part.data.items() if name not in ("type", "max")}
        return FramingSpec(kind.data, options, longest)
    tx = _delimiter(part.must("tx"), encoding, findings)
    rx_part = part.must("rx")
    rx = _delimiter(rx_part, encoding, findings)
    if rx == b"":
        findings.error(
            rx_part,
            "empty-delimiter",
            "an empty delimiter cannot end a frame",
            hint="name what the robot sends after each answer, such as LF or CRLF",
        )
    return FramingSpec("delimiter", {"tx": tx or b"", "rx": rx or b"\n"}, longest)


def _delimiter(part: Part, encoding: str, findings: Findings) -> bytes | None:
    """Return the bytes that a delimiter stands for, or None when it was reported."""
    if isinstance(part.data, list):
        pieces = [_delimiter(inner, encoding, findings) for inner in part.items()]
        return None if None in pieces else b"".join(piece for piece in pieces if piece)
    if not isinstance(part.data, str):
        return bytes((int(part.data),))
    text: str = part.data
    if text in CONTROL_NAMES:
        return CONTROL_NAMES[text]
    in_hex = _HEX.fullmatch(text)
    if in_hex:
        return bytes.fromhex(in_hex[1])
    return _literal(text, part, encoding, findings)


def _literal(text: str, part: Part, encoding: str, findings: Findings) -> bytes | None:
    backslash = _BACKSLASH.search(text)
    if backslash is not None:
        names = [_SPELT.get(escape, escape) for escape in _BACKSLASH.findall(text)]
        spelt = names[0] if len(names) == 1 else "[" + ", ".join(names) + "]"
        spelt = {"[CR, LF]": "CRLF"}.get(spelt, spelt)
        findings.error(
            part,
            "literal-backslash",
            f"these are the {len(text)} characters {text}, not a control character",
            offset=backslash.start(),
            length=len(backslash[0]),
            hint=f'write {spelt}, or "{text}" in double quotes',
        )
        return None
    words = text.replace(",", " ").replace("+", " ").split()
    if words and all(word.upper() in CONTROL_NAMES for word in words):
        spelt = ", ".join(word.upper() for word in words)
        spelt = f"[{spelt}]" if len(words) > 1 else spelt
        findings.error(
            part,
            "bad-delimiter",
            f"{text!r} is no name of a control character",
            hint=f"write {spelt}",
        )
        return None
    try:
        return text.encode(encoding)
    except UnicodeEncodeError:
        findings.error(part, "bad-delimiter", f"{text!r} does not exist in the encoding {encoding}")
        return None


def templates_of(spec: TransportSpec) -> dict[str, Template]:
    """Return the options of a transport that are templates."""
    return {name: value for name, value in spec.options.items() if isinstance(value, Template)}

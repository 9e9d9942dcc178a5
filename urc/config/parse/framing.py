"""Parser for the framing of a transport or reply: mapping → `FramingSpec`."""

from collections.abc import Callable
from re import _constants, _parser  # type: ignore[attr-defined]  # no public API for the syntax tree
from typing import Any, Final

from urc.config.node import Node, Problems
from urc.config.parse.bytes import parse_bytes
from urc.config.parse.checksum import values_of
from urc.config.parse.escape import parse_escape
from urc.config.parse.frame_layout import MARKED, parse_layout
from urc.config.spelling_suggestions import did_you_mean, listed
from urc.model.driver import FramingSpec
from urc.model.framing import FrameLayout
from urc.registry import Registries

__all__ = ["parse_framing"]

_SWITCHABLE: Final = (
    "delimiter", "fixed", "length", "slip", "cobs", "regex", "brackets", "json", "xml",
)  # fmt: skip
"""Framing types that detect the end of a frame from its bytes, as `switch` requires."""
_LINE_WORDS = (
    "line",
    "lines",
    "text",
    "newline",
    "ascii",
    "string",
    "cr",
    "lf",
    "crlf",
)
_LINES = "for lines of text, write framing: { type: delimiter, tx: LF, rx: LF }"


def parse_framing(
    part: Node, encoding: str, problems: Problems, catalog: Registries
) -> FramingSpec:
    """Return the framing at `part`; report invalid values and use defaults."""
    kind = part.must("type")
    if kind.data == "switch" and catalog.framings.get(kind.data) is not None:
        return _switch(part, encoding, problems, catalog)
    longest = part.integer("max") or FramingSpec().max_bytes
    if catalog.framings.get(kind.data) is None:
        problems.error(
            kind,
            "unknown-framing",
            f"there is no framing of type {kind.data!r}",
            hint=_LINES
            if kind.data.lower() in _LINE_WORDS
            else did_you_mean(kind.data, catalog.framings, "types"),
        )
        return FramingSpec(max_bytes=longest)
    parse = _PARSERS.get(kind.data)
    if parse is None:
        options = {name: item for name, item in part.data.items() if name not in ("type", "max")}
        return FramingSpec(kind.data, options, longest)
    options = parse(part, encoding, problems)
    layout = parse_layout(part, encoding, problems, longest)
    if kind.data == "delimiter" and "escape" not in part.data:
        _check_raw(part, layout, options, problems)
    escape = parse_escape(part, layout, options, encoding, problems)
    if escape is not None and escape.is_of_payload:
        layout = layout._replace(escape=escape)
    elif escape is not None:
        options["escape"] = escape
    if layout != FrameLayout() or kind.data in MARKED:
        options["layout"] = layout
    return _with_common_options(part, FramingSpec(kind.data, options, longest), problems)


def _with_common_options(part: Node, spec: FramingSpec, problems: Problems) -> FramingSpec:
    """Return the framing with the options that all framing types share."""
    if "timeout" not in part.data and "strip_ansi" not in part.data:
        return spec
    timeout_s = problems.duration(part, "timeout", 0.0, least=0.001, most=60) or None
    strips = "strip_ansi" in part.data and part.flag("strip_ansi", default=False)
    return spec._replace(timeout_s=timeout_s, strips_ansi=strips)


def _delimiter(part: Node, encoding: str, problems: Problems) -> dict[str, Any]:
    tx = parse_bytes(part.must("tx"), encoding, problems)
    rx_part = part.must("rx")
    rx = parse_bytes(rx_part, encoding, problems)
    if rx == b"":
        problems.error(
            rx_part,
            "empty-delimiter",
            "the delimiter is empty and cannot end a frame",
            hint="write the bytes that end each reply, such as LF or CRLF",
        )
    return {"tx": tx or b"", "rx": rx or b"\n"}


def _check_raw(
    part: Node, layout: FrameLayout, options: dict[str, Any], problems: Problems
) -> None:
    """Warn about a binary checksum that may contain a delimiter."""
    specs = () if layout.digits else (*layout.checksums, layout.checksum)
    trailing = layout.trailer.checksum if layout.trailer else None
    ends = options["tx"] + options["rx"]
    for spec in (*specs, trailing):
        if spec is not None and spec.spelling == "raw" and values_of(spec.algorithm) & {*ends}:
            problems.warn(
                part.must("checksum"),
                "raw-checksum",
                "a binary checksum may contain the delimiter and end its frame too early",
                hint="write 'as: hex', or use a framing with a known frame size",
            )
            return


def _regex(part: Node, encoding: str, problems: Problems) -> dict[str, Any]:
    inner = part.must("pattern")
    if problems.pattern(inner, is_over_bytes=True) is not None:
        _check_pattern(inner, problems)
    return {"pattern": inner.data} | _tx(part, encoding, problems)


def _tx(part: Node, encoding: str, problems: Problems) -> dict[str, Any]:
    tx = parse_bytes(part.get("tx"), encoding, problems)
    return {"tx": tx} if tx else {}


def _idle(part: Node, encoding: str, problems: Problems) -> dict[str, Any]:
    return {"gap_s": problems.duration(part, "gap", 0.02, least=0.001, most=60)}


def _plain(part: Node, encoding: str, problems: Problems) -> dict[str, Any]:
    return {}


_PARSERS: Final[dict[str, Callable[[Node, str, Problems], dict[str, Any]]]] = {
    "delimiter": _delimiter,
    "fixed": _plain,
    "length": _plain,
    "slip": _plain,
    "cobs": _plain,
    "idle": _idle,
    "regex": _regex,
    "brackets": _plain,
    "json": _tx,
    "xml": _tx,
    "datagram": _plain,
}


def _switch(part: Node, encoding: str, problems: Problems, catalog: Registries) -> FramingSpec:
    cases: list[tuple[bytes, FramingSpec]] = []
    for case in part.listed("cases"):
        first_part, inner = case.must("first"), case.must("framing")
        first = parse_bytes(first_part, encoding, problems)
        if not _is_switchable(inner.must("type"), problems):
            continue
        for key in ("timeout", "strip_ansi"):
            if key in inner.data:
                text = f"'{key}' must be a key of the 'switch' framing, not of a case"
                problems.error(inner, "misplaced-key", text, at=key, key=True)
        spec = parse_framing(inner, encoding, problems, catalog)._replace(
            timeout_s=None, strips_ansi=False
        )
        if first is None:
            continue
        if not first:
            problems.error(
                first_part, "empty-mark", "'first' is empty, so this case cannot select a framing"
            )
            continue
        _check_case(first_part, first, spec, cases, problems)
        cases.append((first, spec))
    options: dict[str, Any] = {"cases": tuple(cases)}
    longest = max((spec.max_bytes for _, spec in cases), default=FramingSpec().max_bytes)
    other = part.get("else")
    if other is not None and _is_switchable(other.must("type"), problems):
        options["otherwise"] = parse_framing(other, encoding, problems, catalog)
        longest = max(longest, options["otherwise"].max_bytes)
    return _with_common_options(part, FramingSpec("switch", options, longest), problems)


def _is_switchable(kind: Node, problems: Problems) -> bool:
    if kind.data in _SWITCHABLE:
        return True
    problems.error(
        kind,
        "misplaced-framing",
        f"a case of 'switch' cannot have the type {kind.data!r}",
        hint=f"use a framing that detects the end of each frame: {listed(_SWITCHABLE)}",
    )
    return False


def _check_case(
    part: Node,
    first: bytes,
    spec: FramingSpec,
    before: list[tuple[bytes, FramingSpec]],
    problems: Problems,
) -> None:
    """Report unreachable cases and cases whose framing expects different start bytes."""
    for other, _ in before:
        if first.startswith(other):
            problems.error(
                part,
                "unreachable-case",
                f"frames that start with {first.hex(' ')} match the earlier case {other.hex(' ')}",
                hint="move the case with the longer 'first' above the other case",
            )
            return
    start = getattr(spec.options.get("layout"), "start", b"")
    if start and not (start.startswith(first) or first.startswith(start)):
        problems.error(
            part,
            "never-matches",
            f"the frames of this case start with {start.hex(' ')}, not with {first.hex(' ')}",
        )


_REPEATS = (_constants.MAX_REPEAT, _constants.MIN_REPEAT)


def _check_pattern(part: Node, problems: Problems) -> None:
    """Report mistakes in a framing's pattern, such as an end of variable length."""
    text: str = part.data
    far = next((place for place, char in enumerate(text) if ord(char) > 127), None)
    if far is not None:
        problems.error(
            part,
            "bad-pattern",
            f"{text[far]!r} is not a byte, but the pattern matches bytes",
            offset=far,
            hint="write each byte as \\xHH",
        )
        return
    tree = _parser.parse(text.removeprefix("^"))
    if tree.getwidth()[0] == 0:
        problems.error(
            part,
            "matches-nothing",
            "the pattern also matches an empty frame",
            hint="change the pattern to match at least one byte",
        )
    elif _has_anchor(tree):
        problems.error(
            part,
            "misplaced-anchor",
            "'^', '$' and '\\b' have no effect inside a stream",
            hint="remove the anchors, and end the pattern with the bytes that end a frame",
        )
    elif _is_open(tree):
        problems.error(
            part,
            "open-end",
            "the pattern ends with a part of variable length, so the end of a frame is unclear",
            hint=f"add the end of a frame, such as '{text}\\r\\n'",
        )


def _parts(operation: Any, argument: Any) -> list[Any]:
    """Return the child sequences of one node in a parsed pattern."""
    if operation is _constants.SUBPATTERN:
        return [argument[3]]
    if operation in _REPEATS:
        return [argument[2]]
    return list(argument[1]) if operation is _constants.BRANCH else []


def _has_anchor(tree: Any) -> bool:
    return any(
        operation is _constants.AT or any(map(_has_anchor, _parts(operation, argument)))
        for operation, argument in tree
    )


def _is_open(tree: Any) -> bool:
    """Return whether the last item of a sequence has a variable number of bytes."""
    items = list(tree)
    if not items:
        return True
    operation, argument = items[-1]
    if operation in _REPEATS and argument[0] != argument[1]:
        return True
    return any(map(_is_open, _parts(operation, argument)))

"""Converts YAML events into plain data and a parallel tree of marks.

Private to `urc.source`. The reader processes the events of the YAML parser directly, without the
library's composer. Nesting and aliases are limited *during* reading, so a document with
exponentially many aliases is rejected early. Every key and value has a position, and scalars follow
the core schema of YAML 1.2.
"""

import re
from collections.abc import Callable, Iterable
from typing import Any, Final, NamedTuple

import yaml

from urc._marks import Mark, Span
from urc._yaml_scalars import DIGITS_MAX, resolve_plain
from urc.problems import Problem, Severity

__all__ = ["DocumentLimits", "StoppedError", "TreeReader"]

_TAGS: Final = "tag:yaml.org,2002:"
_PATH_SHOWN: Final = 12
_PROBLEMS_MOST: Final = 100
"""Maximum number of problems in one text. Each problem copies its source line, which may be
long."""
_CUT_COMMENT = re.compile(r" #[^\s#!]")
_OPENING: Final = ("“", "„", "‘", "‚", "«", "»", "”", "’")
_CLOSING: Final = ("”", "“", "’", "‘", "»", "«")
"""Typographic quotes of several languages, which word processors substitute for straight quotes."""


class DocumentLimits(NamedTuple):
    """Limits that bound the time and the memory for reading a document."""

    size_bytes: int = 1 << 20
    depth: int = 64
    """Maximum nesting depth of mappings and lists, including aliases."""
    nodes: int = 10_000
    """Maximum number of keys, values, mappings and lists, with every alias expanded."""


class StoppedError(Exception):
    """Raised when an error stops the reader; the reader's last problem describes the error."""


class _Built(NamedTuple):
    value: object
    mark: Mark
    nodes: int
    height: int


class TreeReader:
    """A reader that builds one document from parser events, and collects `problems`."""

    def __init__(self, parser: Any, lines: list[str], file: str, limits: DocumentLimits) -> None:
        self.problems: list[Problem] = []
        self._next: Callable[[], Any] = parser.get_event
        self._lines = lines
        self._file = file
        self._limits = limits
        self._nodes = 0
        self._path: list[str] = []
        self._anchors: dict[str, _Built | None] = {}
        """Anchored nodes by anchor name; None while a node is being read."""

    def read(self) -> tuple[object, Mark] | None:
        """Return the data and marks of the document; None for text without a document.

        Raises:
            StoppedError: the rest of the text cannot be parsed.
            yaml.YAMLError: the text is not YAML.
        """
        self._next()  # the start of the stream
        if isinstance(self._next(), yaml.StreamEndEvent):
            return None
        built = self._node(self._next(), 1)
        self._next()  # the end of the document
        rest = self._next()
        if not isinstance(rest, yaml.StreamEndEvent):
            self._report(
                rest,
                "several-documents",
                "a second document starts here",
                hint="a file contains only one document:"
                " move the second document to a separate file",
            )
        return built.value, built.mark

    def _node(self, event: Any, depth: int) -> _Built:
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event, depth)
        self._spend(1, event)
        before = self._nodes
        anchor = event.anchor
        if anchor is not None:
            self._anchors[anchor] = None
        mark = Mark(_span(event), event.style or "" if type(event) is yaml.ScalarEvent else "{")
        value: object
        if type(event) is yaml.ScalarEvent:
            value, height = self._scalar(event), 0
        elif depth > self._limits.depth:
            self._report(event, "too-deep", f"more than {self._limits.depth} levels of nesting")
            raise StoppedError
        elif isinstance(event, yaml.MappingStartEvent):
            value, height = self._mapping(event, mark, depth)
        else:
            value, height = self._list(event, mark, depth)
        built = _Built(value, mark, self._nodes - before + 1, height)
        if anchor is not None:
            self._anchors[anchor] = built
        return built

    def _alias(self, event: Any, depth: int) -> _Built:
        name = event.anchor
        built = self._anchors.get(name)
        if built is None:
            if name in self._anchors:
                self._report(event, "alias-loop", f"'*{name}' is inside its own anchor")
                raise StoppedError
            self._report(
                event,
                "unknown-alias",
                f"there is no anchor '&{name}' above this '*{name}'",
                hint=f"if it is text, {self._advice(event)}",
            )
            return _Built(None, Mark(_span(event), "*"), 1, 0)
        self._spend(built.nodes, event)
        if depth + built.height - 1 > self._limits.depth:
            self._report(event, "too-deep", f"more than {self._limits.depth} levels of nesting")
            raise StoppedError
        return built._replace(mark=Mark(_span(event), "*", built.mark.children))

    def _mapping(self, start: Any, mark: Mark, depth: int) -> tuple[dict[str, object], int]:
        self._check_collection_tag(start, "map")
        data: dict[str, object] = {}
        height = 0
        event: Any
        before: Any = None
        told: Any = None
        while not isinstance(event := self._next(), yaml.MappingEndEvent):
            ahead = self._next() if type(event) is yaml.ScalarEvent else None
            if before is not None and self._is_bare(event, ahead):
                self._spend(2, event)
                if before is not told:
                    self._report_comma(event, before)
                    told = before
                continue
            key = self._key(event, start, depth)
            self._path.append("" if key is None else key)
            value = self._next() if ahead is None else ahead
            before = value if start.flow_style and _is_plain(value) else None
            built = self._node(value, depth + 1)
            self._path.pop()
            height = max(height, built.height)
            if key is None:
                continue
            if key in data:
                self._report_duplicate(key, event, mark)
                continue
            data[key] = built.value
            built.mark.key = _span(event)
            mark.children[key] = built.mark
        _close(mark, event)
        return data, height + 1

    def _list(self, start: Any, mark: Mark, depth: int) -> tuple[list[object], int]:
        self._check_collection_tag(start, "seq")
        items: list[object] = []
        height = 0
        event: Any
        while not isinstance(event := self._next(), yaml.SequenceEndEvent):
            self._path.append(str(len(items)))
            built = self._node(event, depth + 1)
            self._path.pop()
            height = max(height, built.height)
            mark.children[len(items)] = built.mark
            items.append(built.value)
        _close(mark, event)
        return items, height + 1

    def _key(self, event: Any, start: Any, depth: int) -> str | None:
        """Return the next key; report an invalid key, skip the key's value and return None."""
        if type(event) is not yaml.ScalarEvent:
            self._node(event, depth + 1)
            self._report_complex_key(event, start)
            return None
        self._spend(1, event)
        if event.value == "<<" and not event.style and event.tag is None:
            self._report(
                event,
                "merge-key",
                "the merge key '<<' is not part of YAML 1.2",
                hint="write the keys in full, or give the whole value an anchor",
            )
            return None
        key = self._scalar(event, is_key=True)
        if isinstance(key, str):
            return key
        if not event.value and not event.style:
            self._report(event, "key-not-text", "a key is missing before ':'")
        else:
            self._report(
                event,
                "key-not-text",
                f"a key must be text, found {event.value}",
                hint=f'quote it: "{event.value}":',
            )
        return None

    def _scalar(self, event: Any, *, is_key: bool = False) -> object:
        text: str = event.value
        tag: str | None = event.tag
        try:
            if tag is not None and tag != "!":
                return self._tagged(event, text, tag)
            if event.style or tag == "!":
                return text
            value = resolve_plain(text)
        except ValueError as error:
            self._report(
                event,
                "number-too-long",
                f"found {error}; the limit is {DIGITS_MAX}",
                hint="quote the value if it is text",
            )
            return None
        if not is_key and (value is None or isinstance(value, str)):
            self._warn_of_cut(event)
            if text[:1] in _OPENING and text[-1:] in _CLOSING and len(text) > 1:
                self._warn_of_quotes(event, text[1:-1])
        return value

    def _tagged(self, event: Any, text: str, tag: str) -> object:
        kind = tag.removeprefix(_TAGS)
        if kind == "str":
            return text
        value = resolve_plain(text)
        names = {bool: "bool", int: "int", float: "float", type(None): "null"}
        found = names.get(type(value), "str")
        if found == kind or (kind, found) == ("float", "int"):
            return value
        if kind in names.values():
            self._report(event, "wrong-tag", f"{text!r} is not of type {kind}")
        else:
            self._report_tag(event, tag)
        return None

    def _check_collection_tag(self, event: Any, expected: str) -> None:
        if event.tag not in (None, "!", _TAGS + expected):
            self._report_tag(event, event.tag)

    def _report_tag(self, event: Any, tag: str) -> None:
        shown = "!!" + tag.removeprefix(_TAGS) if tag.startswith(_TAGS) else tag
        self._report(
            event,
            "unknown-tag",
            f"{shown!r} at the start of a value is a YAML tag; tags are not supported",
            hint=f"if it is text, {self._advice(event)}",
        )

    def _report_duplicate(self, key: str, event: Any, mark: Mark) -> None:
        first = mark.children[key].key
        place = f"at line {first.line}, column {first.column}" if first else "above"
        self._report(
            event,
            "duplicate-key",
            f"{key!r} occurs twice; the first is {place}",
            hint="keep one of them: a later key never overrides an earlier key",
        )

    def _report_complex_key(self, event: Any, start: Any) -> None:
        line = self._line(start.start_mark.line)
        begin = start.start_mark.column
        if line[begin : begin + 2] == "{{" and event.start_mark.index == start.start_mark.index + 1:
            from urc._yaml_faults import UNQUOTED_TEMPLATE

            end = line.find("}}", begin)
            self._report(
                start,
                "unquoted-template",
                UNQUOTED_TEMPLATE,
                hint=self._advice(start),
                length=max(end + 2 - begin, 2),
            )
            return
        what = "an alias" if isinstance(event, yaml.AliasEvent) else "a mapping or list"
        self._report(event, "key-not-text", f"a key must be text, found {what}")

    def _is_bare(self, key: Any, value: Any) -> bool:
        """Return whether no colon follows the key."""
        is_text = _is_plain(key) and type(value) is yaml.ScalarEvent
        if not is_text or value.value or value.style:
            return False
        end = key.end_mark
        return not self._line(end.line)[end.column :].lstrip().startswith(":")

    def _report_comma(self, event: Any, before: Any) -> None:
        """Report a key that has no colon because of a comma in unquoted text."""
        self._report(
            event,
            "unquoted",
            "inside { }, a comma ends unquoted text, so this is a separate key",
            hint=f'quote the text: "{before.value}, {event.value}"',
            length=max(1, len(event.value)),
        )

    def _warn_of_cut(self, event: Any) -> None:
        end = event.end_mark
        line = self._line(end.line)
        if not _CUT_COMMENT.match(line, end.column):
            return
        start = event.start_mark.column if event.value else end.column + 1
        from urc._yaml_faults import advice

        whole = advice(line, start, has_comment=False)
        self._report(
            event,
            "cut-value",
            "the value ends before ' #', because a comment starts there",
            hint=f"if '#' belongs to the value, {whole}; otherwise, write '# ' with a space",
            severity="warning",
        )

    def _warn_of_quotes(self, event: Any, inner: str) -> None:
        is_plain = not {'"', "\\"} & {*inner}
        self._report(
            event,
            "typographic-quotes",
            "typographic quotes are part of the text",
            hint="write straight quotes" + (f': "{inner}"' if is_plain else ""),
            severity="warning",
        )

    def _advice(self, event: Any) -> str:
        from urc._yaml_faults import advice  # only broken documents need its patterns

        return advice(self._line(event.start_mark.line), event.start_mark.column)

    def _line(self, number: int) -> str:
        return self._lines[number] if number < len(self._lines) else ""

    def _spend(self, nodes: int, event: Any) -> None:
        self._nodes += nodes
        if self._nodes > self._limits.nodes:
            self._report(
                event,
                "too-many-nodes",
                f"more than {self._limits.nodes} keys and values after alias expansion",
            )
            raise StoppedError

    def _report(
        self,
        event: Any,
        code: str,
        message: str,
        *,
        hint: str = "",
        length: int = 0,
        severity: Severity = "error",
    ) -> None:
        start, end = event.start_mark, event.end_mark
        end_column = end.column + 1 if end.line == start.line else 0
        if length:
            end_column = start.column + 1 + length
        parts = [part for part in self._path if part]
        path = ".".join(parts if len(parts) <= _PATH_SHOWN else (*parts[:_PATH_SHOWN], "…"))
        self.problems.append(
            Problem(
                code,
                message,
                self._file,
                start.line + 1,
                start.column + 1,
                end_column,
                path,
                hint,
                self._line(start.line),
                severity,
            )
        )
        if len(self.problems) >= _PROBLEMS_MOST:
            raise StoppedError


def _is_plain(event: Any) -> bool:
    return type(event) is yaml.ScalarEvent and bool(event.value) and not event.style


def _span(event: Any) -> Span:
    start, end = event.start_mark, event.end_mark
    return Span(start.line + 1, start.column + 1, end.line + 1, end.column + 1)


def path_text(path: Iterable[str | int]) -> str:
    """Return the text of a path: ``("polls", 0, "send")`` becomes ``polls.0.send``."""
    parts = (str(part) for part in path)
    return ".".join(part if len(part) <= 64 else part[:63] + "…" for part in parts)


def _close(mark: Mark, end: Any) -> None:
    """Extend the mark of a mapping or list to the position of its end event."""
    line, column = end.end_mark.line + 1, end.end_mark.column + 1
    mark.span = mark.span._replace(end_line=line, end_column=column)

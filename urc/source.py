"""Converts YAML text into a `Document`: plain data with the position of every value.

This module is independent of robots. All errors are raised as `ProblemsError` with the position and
a hint. Reading takes bounded time and memory for any content.
"""

import contextlib
import re
from collections.abc import Sequence
from typing import Any, Final

import yaml

from urc._files import read_bytes, refused, similar_file, too_large
from urc._marks import Mark, Span, UnfilledText
from urc._yaml_tree import DocumentLimits, StoppedError, TreeReader, path_text
from urc.problems import Problem, ProblemsError, Severity, has_errors

__all__ = [
    "Document",
    "DocumentLimits",
    "Mark",
    "Path",
    "Span",
    "UnfilledText",
    "parse_document",
    "read_document",
    "similar_file",
]

Path = tuple[str | int, ...]
"""Path of a value in a document: keys and list indices, from the root."""

_LIMITS: Final = DocumentLimits()
# These patterns and the YAML reader use the same line ends, so marks count the same lines. The
# Unicode patterns take milliseconds to compile, so they are compiled only for text that needs them.
_LINE_END = re.compile("\r\n|[\r\n]")
_NESTING: Final = "exceeded maximum nesting depth"
"""Error message of libyaml at 1,000 levels of nesting, since PyYAML 6.0.4."""
_LINE_END_UNICODE: Final = "\r\n|[\r\n\x85\u2028\u2029]"
_UNPRINTABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
_UNPRINTABLE_UNICODE: Final = "[^\t\r\n\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
_ESCAPE = re.compile(r"\\(?:x.{2}|u.{4}|U.{8}|.)", re.DOTALL)


class Document:
    """The content of one file, with the position of every key and value. Immutable after reading.

    Parts of the data may come from other documents; `source_of` returns the document of a value.
    """

    __slots__ = ("data", "file", "lines", "mark", "problems", "text")

    def __init__(
        self,
        file: str,
        text: str,
        lines: Sequence[str],
        data: object,
        mark: Mark,
        problems: tuple[Problem, ...] = (),
    ) -> None:
        self.file = file
        """Name of the file, for messages and references."""
        self.text = text
        self.lines = lines
        self.data = data
        """Content of the document: mappings with text keys, lists, text, numbers, booleans and
        None."""
        self.mark = mark
        """Mark of the root value; `at` returns the mark of any value."""
        self.problems = problems
        """Warnings from reading the document; errors raise an exception instead."""

    def at(self, path: Path) -> Mark | None:
        """Return the mark of the value at `path`; None for a missing value."""
        mark = self.mark
        for part in path:
            inner = mark.children.get(part)
            if inner is None:
                return None
            mark = inner
        return mark

    def line_starts(self) -> list[int]:
        """Return the 0-based character offset of each line in `text`."""
        ends = _LINE_END if self.text.isascii() else re.compile(_LINE_END_UNICODE)
        return [0, *(end.end() for end in ends.finditer(self.text))]

    def source_of(self, path: Path) -> "Document":
        """Return the document that contains the value at `path`, or the value's nearest parent."""
        return self._nearest(path)[0]

    def problem(
        self,
        path: Path,
        code: str,
        message: str,
        *,
        hint: str = "",
        key: bool = False,
        offset: int | None = None,
        length: int = 1,
        severity: Severity = "error",
    ) -> Problem:
        """Return a problem for the value at `path`, with the source line.

        Args:
            path: path of the value; for a missing value, the problem points at the nearest parent.
            code: code of the problem, such as ``unknown-key``.
            message: one line that states the actual and the expected content.
            hint: suggested correction.
            key: whether the problem points at the key instead of the value.
            offset: 0-based character position in the value at `path`.
            length: number of characters to underline from `offset`.
            severity: ``error`` or ``warning``.
        """
        home, mark, depth = self._nearest(path)
        span = _span(mark, key=key, is_inside=depth < len(path))
        if offset is not None and not key and depth == len(path):
            span = home.inside(mark, self._text_at(path), offset, length) or span
        end_column = span.end_column if span.end_line == span.line else 0
        source = home.lines[span.line - 1] if span.line <= len(home.lines) else ""
        return Problem(
            code,
            message,
            home.file,
            span.line,
            span.column,
            end_column,
            path_text(path),
            hint,
            source,
            severity,
        )

    def _nearest(self, path: Path) -> tuple["Document", Mark, int]:
        """Return the document, mark and depth of the value at `path`, or of its nearest parent."""
        home: Document = self.mark.origin or self
        mark, depth = self.mark, 0
        for part in path:
            inner = mark.children.get(part)
            if inner is None:
                break
            mark, depth = inner, depth + 1
            home = mark.origin or home
        return home, mark, depth

    def _text_at(self, path: Path) -> str | None:
        value = self.data
        for part in path:
            value = value[part] if isinstance(value, (dict, list)) else None  # type: ignore[index]
        return value if isinstance(value, str) else None

    def inside(self, mark: Mark, text: str | None, offset: int, length: int) -> Span | None:
        """Return the position of a value's characters in the document's text; None if unknown."""
        written = mark.written
        if written is not None:
            end = written.offset(offset + length)
            offset, text = written.offset(offset), written.text
            length = max(end - offset, 1)
        if text is None or mark.style == "*":
            return None
        span = mark.span
        if mark.style in ("|", ">") or span.line != span.end_line:
            return _inside_lines(self.lines, span, text, offset, length)
        raw = self.lines[span.line - 1]
        start = _raw_column(raw, span.column - 1, mark.style, offset)
        end = _raw_column(raw, span.column - 1, mark.style, min(offset + length, len(text)))
        start = min(start, max(span.end_column - 2, 0))
        return Span(span.line, start + 1, span.line, max(end, start + 1) + 1)


def _span(mark: Mark, *, key: bool, is_inside: bool) -> Span:
    """Return the span to underline for a value: the key, the value, or the first character."""
    wants_key = key or is_inside or mark.style == "{"
    if wants_key and mark.key is not None and (key or "{" in mark.style):
        return mark.key
    # The end of a mapping or list is not useful, so only the first character is underlined.
    return mark.span._replace(end_line=0) if mark.style == "{" else mark.span


def read_document(path: str, limits: DocumentLimits = _LIMITS) -> Document:
    """Return the document in a file.

    Raises:
        ProblemsError: the file cannot be read or is not a YAML document within `limits`.
    """
    return parse_document(read_bytes(path, limits.size_bytes), path, limits)


def parse_document(content: bytes | str, file: str, limits: DocumentLimits = _LIMITS) -> Document:
    """Parse YAML text into a document; `file` is the file name in messages.

    Raises:
        ProblemsError: the text is not a YAML document within `limits`.
    """
    text = content if isinstance(content, str) else _decode(content, file)
    text = text.removeprefix("\ufeff")
    if len(text) > limits.size_bytes:
        raise refused(file, "too-large", too_large(limits.size_bytes))
    lines = _lines(text)
    _check_characters(text, file, lines)
    reader, found = None, None
    problems: list[Problem] = []
    try:
        parser = _parser(text)
        reader = TreeReader(parser, lines, file, limits)
        found = reader.read()
    except StoppedError:
        pass
    except yaml.YAMLError as error:
        if _NESTING in str(error):  # libyaml reads ahead; the reader's own limit names the place
            reader = _depth_checked(text, lines, file, limits)
        else:
            problems.append(_syntax_problem(error, file, lines))
    if reader is not None:
        told = {problem.line for problem in reader.problems}
        # An unquoted value often causes a later parser error, and one problem per line is enough.
        problems = [*reader.problems, *(p for p in problems if p.line not in told)]
    if has_errors(problems):
        raise ProblemsError(sorted(problems, key=lambda found: (found.line, found.column)))
    if found is None or found[0] is None:
        raise refused(
            file,
            "empty-document",
            "the document is empty",
            "a document starts with 'urc: 1' and 'kind: robot'",
        )
    return Document(file, text, lines, *found, tuple(problems))


def _depth_checked(text: str, lines: list[str], file: str, limits: DocumentLimits) -> TreeReader:
    """Return a reader that has stopped at the depth limit, for text that libyaml refuses."""
    from urc._yaml_pure import PureParser

    reader = TreeReader(PureParser(text), lines, file, limits)
    with contextlib.suppress(StoppedError, yaml.YAMLError):
        reader.read()
    return reader


def _parser(text: str) -> Any:
    try:
        from yaml.cyaml import CParser  # type: ignore[attr-defined]  # the stubs hide it
    except ImportError:  # PyYAML without libyaml: seven times slower, same events
        from urc._yaml_pure import PureParser

        return PureParser(text)
    return CParser(text)


def _decode(content: bytes, file: str) -> str:
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise refused(
            file,
            "not-utf-8",
            "this file is UTF-16; documents must be UTF-8",
            "save the file as UTF-8",
        )
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError as error:
        good = _lines(content[: error.start].decode("utf-8"))
        if b"\0" in content:
            raise refused(file, "binary-file", "this is a binary file, not a document") from None
        raise ProblemsError(
            [
                Problem(
                    "not-utf-8",
                    f"the byte 0x{content[error.start]:02x} here is not UTF-8",
                    file,
                    len(good),
                    len(good[-1]) + 1,
                    hint="save the file as UTF-8",
                )
            ]
        ) from None
    if "\0" in text:
        raise refused(file, "binary-file", "this is a binary file, not a document")
    return text


def _lines(text: str) -> list[str]:
    return _LINE_END.split(text) if text.isascii() else re.split(_LINE_END_UNICODE, text)


def _check_characters(text: str, file: str, lines: Sequence[str]) -> None:
    found = _UNPRINTABLE.search(text)
    if found is None and not text.isascii():
        found = re.search(_UNPRINTABLE_UNICODE, text)
    if found is None:
        return
    before = _lines(text[: found.start()])
    line, column = len(before), len(before[-1]) + 1
    raise ProblemsError(
        [
            Problem(
                "control-character",
                f"the character U+{ord(found[0]):04X} is not allowed in YAML",
                file,
                line,
                column,
                column + 1,
                source=lines[line - 1],
                hint='write the character as an escape in double quotes, such as "\\x07"',
            )
        ]
    )


def _syntax_problem(error: yaml.YAMLError, file: str, lines: Sequence[str]) -> Problem:
    from urc._yaml_faults import explain

    fault = explain(error, lines)
    line = min(fault.line, len(lines) - 1)
    return Problem(
        fault.code,
        fault.message,
        file,
        line + 1,
        fault.column + 1,
        hint=fault.hint,
        source=lines[line],
    )


def _raw_column(raw: str, start: int, style: str, offset: int) -> int:
    """Return the 0-based column of character `offset` of a scalar that starts at `start`."""
    if style not in ("'", '"'):
        return start + offset
    column = start + 1
    for _ in range(offset):
        if style == "'":
            column += 2 if raw.startswith("''", column) else 1
        else:
            escape = _ESCAPE.match(raw, column)
            column = escape.end() if escape else column + 1
    return column


def _inside_lines(
    lines: Sequence[str], span: Span, value: str, offset: int, length: int
) -> Span | None:
    """Return the position of part of a multi-line scalar in the document's text.

    The function finds the position by searching for each source line in the value. Block scalars,
    plain text, and quoted text without escapes are supported.
    """
    position = 0
    last = min(span.end_line, len(lines))
    for number in range(span.line, last + 1):
        raw = lines[number - 1]
        first = span.column - 1 if number == span.line else 0
        if number == span.line and raw[first : first + 1] in ("|", ">"):
            continue
        if number == last and number > span.line:
            raw = raw[: max(span.end_column - 1, 0)] if raw[:1].strip() else raw
        content = raw[first:].strip().strip("'\"")
        place = value.find(content, position) if content else -1
        if place < 0:
            continue
        if offset < place + len(content):
            column = raw.index(content, first) + max(offset - place, 0) + 1
            end = min(column + length, raw.index(content, first) + len(content) + 1)
            return Span(number, column, number, max(end, column + 1))
        position = place + len(content)
    return None

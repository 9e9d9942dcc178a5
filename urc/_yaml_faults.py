"""Translates YAML parser errors into messages and hints for people.

Private to `urc.source`. The module supports both parsers of PyYAML (C and pure Python). The C
parser and the Python parser report different messages, so most decisions depend on the document's
text at the error.
"""

import re
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import yaml

from urc._yaml_layout import (
    column_hint,
    entry_hint,
    item_hint,
    missing_comma,
    open_braces,
    runaway_quote,
)

__all__ = ["UNQUOTED_TEMPLATE", "SyntaxFault", "advice", "explain"]

_QUOTED_VALUE = re.compile(r"""^(?:[^'"]*?[:\-,{\[]\s+|\s*)(?P<value>'[^']*'|"[^"]*")\s*\S""")
_LAST_ALIAS = re.compile(r"(?:^|[\s:,\[{])(?P<alias>\*[\w-]+)\s*$")
UNQUOTED_TEMPLATE: Final = "a value that starts with '{{' must be quoted"
_RESERVED: Final = "%@`"
_SIGN: Final = "{!r} at the start of a value is YAML syntax, not text"


class SyntaxFault(NamedTuple):
    """A YAML syntax error; `line` and `column` are 0-based, as in the parser."""

    line: int
    column: int
    code: str
    message: str
    hint: str = ""


class _Clue(NamedTuple):
    """A YAML parser's message and position, with the lines of the document."""

    said: str
    context: str
    line: int
    column: int
    opened_line: int
    opened_column: int
    lines: Sequence[str]

    @property
    def text(self) -> str:
        return self._line(self.line)

    @property
    def opened_text(self) -> str:
        return self._line(self.opened_line)

    def _line(self, number: int) -> str:
        return self.lines[number] if number < len(self.lines) else ""


def explain(error: yaml.YAMLError, lines: Sequence[str]) -> SyntaxFault:
    """Translate a parser error into a message and a hint, at the position of the probable cause."""
    mark = getattr(error, "problem_mark", None)
    opened = getattr(error, "context_mark", None) or mark
    said = str(getattr(error, "problem", None) or error).splitlines()[0]
    context = str(getattr(error, "context", None) or "")
    line, column = (mark.line, mark.column) if mark else (0, 0)
    from_line, from_column = (opened.line, opened.column) if opened else (line, column)
    clue = _Clue(said, context, line, column, from_line, from_column, lines)
    for rule in _RULES:
        fault = rule(clue)
        if fault is not None:
            return fault
    return SyntaxFault(clue.line, clue.column, "not-yaml", f"this is not YAML: {said}")


def _tab(at: _Clue) -> SyntaxFault | None:
    indent = at.text[: len(at.text) - len(at.text.lstrip())]
    if "\t" not in indent or at.column > len(indent) or "quoted" in at.context:
        return None
    return SyntaxFault(
        at.line,
        indent.index("\t"),
        "tab",
        "a tab in the indentation",
        "YAML indents with spaces only: two for each level",
    )


def _directive(at: _Clue) -> SyntaxFault | None:
    first = next((n for n, line in enumerate(at.lines) if line.startswith("%")), None)
    words = ("directive", "document start", "incompatible YAML", "duplicate %YAML")
    if first is None or not any(word in at.said or word in at.context for word in words):
        return None
    return SyntaxFault(
        first,
        0,
        "unquoted",
        "a line that starts with '%' is a YAML directive",
        "quote the value if it is text; URC documents need no directives",
    )


def _reserved(at: _Clue) -> SyntaxFault | None:
    if "cannot start any token" not in at.said:
        return None
    char = at.text[at.column : at.column + 1]
    if char == "\t":
        return SyntaxFault(
            at.line, at.column, "tab", "a tab where YAML needs a space", "use spaces"
        )
    if char not in _RESERVED:
        return None
    return SyntaxFault(
        at.line,
        at.column,
        "unquoted",
        f"an unquoted value cannot start with {char!r}",
        advice(at.text, at.column),
    )


def _escape(at: _Clue) -> SyntaxFault | None:
    words = ("escape", "hexdecimal", "Unicode", "hexadecimal")
    if "quoted scalar" not in at.context or not any(word in at.said for word in words):
        return None
    column = max(at.text.rfind("\\", 0, at.column + 1), 0)  # the pure parser points after it
    shown = at.text[column : column + 2]
    return SyntaxFault(
        at.line,
        column,
        "bad-escape",
        f"'{shown}' is not a valid escape in double quotes",
        "use single quotes, where a backslash is plain text and '' is a quote; in double quotes,"
        " write a backslash as \\\\",
    )


def _open_quote(at: _Clue) -> SyntaxFault | None:
    if "quoted scalar" not in at.context:
        return None
    quote = at.opened_text[at.opened_column : at.opened_column + 1]
    name = "single" if quote == "'" else "double"
    hint = f"end the text with {quote}"
    if quote == "'" and at.opened_text.count("'") > 1:
        hint += "; a quote inside single quotes is written twice: ''"
    return SyntaxFault(
        at.opened_line, at.opened_column, "open-quote", f"this {name} quote is never closed", hint
    )


def _runaway_quote(at: _Clue) -> SyntaxFault | None:
    words = ("expected key", "block end", "',' or", "values are not allowed", "expected ':'")
    if not any(word in at.said for word in words):
        return None
    found = runaway_quote(at.lines, at.line, at.column) if at.text else None
    if found is None:
        return None
    line, column, quote = found
    name = "single" if quote == "'" else "double"
    return SyntaxFault(
        line,
        column,
        "open-quote",
        f"this {name} quote is closed only in line {at.line + 1}",
        f"end the text with {quote}",
    )


def _indicator(at: _Clue) -> SyntaxFault | None:
    for word, char in (("alias", "*"), ("anchor", "&"), ("tag", "!")):
        if re.search(rf"an? {word}\b", at.context) or f"{word} handle" in at.said:
            return SyntaxFault(
                at.opened_line,
                at.opened_column,
                "unquoted",
                _SIGN.format(char),
                advice(at.opened_text, at.opened_column),
            )
    # libyaml ends an alias before '?', so `*IDN?` becomes an alias and the start of a key.
    found = _LAST_ALIAS.search(at.text[: at.column])
    if found is None:
        return None
    start = found.start("alias")
    return SyntaxFault(at.line, start, "unquoted", _SIGN.format("*"), advice(at.text, start))


def _after_quote(at: _Clue) -> SyntaxFault | None:
    if not any(word in at.said for word in ("expected key", "block end", "',' or")):
        return None
    found = _QUOTED_VALUE.match(at.text[: at.column + 1])
    if found is None or found.end() != at.column + 1:
        return None
    hint = (
        "a quote inside single quotes is written twice: ''"
        if found["value"][0] == "'"
        else 'a quote inside double quotes is written \\"'
    )
    return SyntaxFault(at.line, at.column, "after-quote", "text after the closing quote", hint)


def _flow(at: _Clue) -> SyntaxFault | None:
    if "flow mapping" not in at.context and "flow sequence" not in at.context:
        return None
    column = at.opened_column
    for start in (column - 1, column):
        if start >= 0 and at.opened_text[start : start + 2] == "{{":
            return SyntaxFault(
                at.opened_line,
                start,
                "unquoted-template",
                UNQUOTED_TEMPLATE,
                advice(at.opened_text, start),
            )
    bracket, other = ("{", "}") if "mapping" in at.context else ("[", "]")
    comma = missing_comma(at.text, at.column) if at.line == at.opened_line else None
    if comma is not None:
        key = re.match(r"[\w-]+", at.text[comma:])
        name = key[0] if key else ""
        return SyntaxFault(
            at.line,
            comma,
            "open-bracket",
            f"a comma is missing before the key {name!r}",
            f"put a comma before the key: ', {name}'",
        )
    rest = [at.text[at.column :], *at.lines[at.line + 1 :]]
    is_end = not any(line.strip() for line in rest)  # the two parsers count the end differently
    place = "the end" if is_end else f"line {at.line + 1}, column {at.column + 1}"
    return SyntaxFault(
        at.opened_line,
        column,
        "open-bracket",
        f"{bracket!r} is opened here, and ',' or {other!r} is missing before {place}",
        f"close it with {other!r} at the end of this line"
        if (is_end or at.line > at.opened_line) and open_braces(at.opened_text)
        else f"close it with {other!r}; a value with special characters needs quotes",
    )


def _block(at: _Clue) -> SyntaxFault | None:
    said, place = at.said, (at.line, at.column)
    if "mapping values are not allowed" in said:
        return _second_colon(at)
    if "sequence entries are not allowed" in said:
        return SyntaxFault(
            *place,
            "not-yaml",
            "a list cannot start on the line of its key",
            "write the first '- ' on a line of its own, or use [a, b]",
        )
    if "mapping keys are not allowed" in said:
        return SyntaxFault(*place, "unquoted", _SIGN.format("?"), advice(at.text, at.column))
    if "could not find expected ':'" in said:
        return SyntaxFault(
            at.opened_line,
            at.opened_column,
            "no-colon",
            "a line without ': ' between key and value",
            entry_hint(at.opened_text.strip()),
        )
    if "expected key" in said or "block end" in said or "'-' indicator" in said:
        return SyntaxFault(
            *place,
            "indentation",
            "the indentation of this line does not match its block",
            (at.text and column_hint(at.lines, at.line))
            or "indent the line like the rest of its block; quote values with special characters",
        )
    if "<document start>" in said:
        return SyntaxFault(
            *place,
            "indentation",
            "this line does not continue the lines above",
            "start every top-level key in column 1, as 'key: value'",
        )
    return None


def _second_colon(at: _Clue) -> SyntaxFault:
    before = re.search(r": +\S", at.text[: at.column])
    if before is not None:
        return SyntaxFault(
            at.line,
            at.column,
            "unquoted",
            "a second ': ' in an unquoted value",
            advice(at.text, before.end() - 1),
        )
    above = at.lines[at.line - 1] if at.line else ""
    is_text = above.strip() and not above.lstrip().startswith("#")
    if is_text and not re.search(r":(\s|$)", above):
        return SyntaxFault(
            at.line - 1,
            len(above) - len(above.lstrip()),
            "no-colon",
            "a line without ': ' between key and value",
            entry_hint(above.strip()),
        )
    if hint := item_hint(above):
        start = len(above) - len(above.lstrip())
        message = "a list item without a space after its dash"
        return SyntaxFault(at.line - 1, start, "indentation", message, hint)
    return SyntaxFault(
        at.line,
        len(at.text) - len(at.text.lstrip()),
        "indentation",
        "this line is indented more than the line above, which already has a value",
        column_hint(at.lines, at.line) or "give both lines the same indentation",
    )


def _rest(at: _Clue) -> SyntaxFault | None:
    place = (at.line, at.column)
    if "node content" in at.said:
        char = at.text[at.column : at.column + 1]
        if not char:
            return SyntaxFault(
                *place, "not-yaml", "a value is expected here", "close the open brackets and quotes"
            )
        return SyntaxFault(
            *place,
            "not-yaml",
            f"expected a value, found {char!r}",
            "quote the value if it is text",
        )
    if "block scalar" in at.context:
        return SyntaxFault(
            *place,
            "not-yaml",
            "only '+', '-' or a digit may follow '|' or '>' on this line",
            "start the text on the next line",
        )
    return None


_RULES: tuple[Callable[[_Clue], SyntaxFault | None], ...] = (
    _tab,
    _directive,
    _reserved,
    _escape,
    _open_quote,
    _runaway_quote,
    _indicator,
    _after_quote,
    _flow,
    _block,
    _rest,
)


def advice(text: str, column: int, *, has_comment: bool = True) -> str:
    """Return a hint that suggests quoting the value at the 0-based `column` of the line `text`."""
    rest = text[column:].split(" #")[0] if has_comment else text[column:]
    before = text[:column]
    if before.count("{") > before.count("}") or before.count("[") > before.count("]"):
        found = re.match(r"\{\{.*?\}\}|[^,}\]]*", rest)
        rest = found[0] if found else rest
    rest = rest.rstrip()
    if not rest or len(rest) > 80 or ("'" in rest and ('"' in rest or "\\" in rest)):
        return "quote it"
    mark = '"' if "'" in rest else "'"
    return f"quote it: {mark}{rest}{mark}"

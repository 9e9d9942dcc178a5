"""Templates and expressions in documents: a subset of Jinja, compiled to Python functions.

`urc._grammar` defines the supported subset. The sandbox for expressions permits no attributes of
Python objects, no loops, and no operators that turn short text into very long text. Expressions can
call only the filters of `urc.filters.table`. Literal text is preserved exactly, whereas Jinja
converts CR to LF and drops a final newline. URC raises errors that Jinja hides, because a wrong
reading must not become zero. In Jinja, ``'abc' | int`` is 0.

If a template consists of a single ``{{ expression }}``, its result has the expression's type.
"""

import ast
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

from urc._formatting import quoted, spelt
from urc._grammar import COUNTERS, NONCE, ExpressionSyntaxError, translate
from urc.filters import table
from urc.problems import UrcError

__all__ = [
    "COUNTERS",
    "NONCE",
    "NOW",
    "ExpressionError",
    "Template",
    "compile_expression",
    "compile_template",
    "defaulted_names",
    "digested_settings",
    "is_byte_filter",
    "is_nonce",
    "last_filter",
    "quoted",
    "spelt",
    "split_template",
    "text_of",
]

NOW: Final = "now"
"""Name ``now`` in expressions: the current Unix time, in seconds."""
_HASHES: Final = frozenset(f"_filter_{name}" for name in ("md5", "sha1", "sha256", "hmac_sha256"))
_SUMMARIES: Final = frozenset(("_filter_length", "_is_defined", "_is_none", "_match", "_search"))
"""Functions whose results, such as a length, reveal almost nothing about their operands."""
_NONCE: Final = re.compile(rf"ns\['{re.escape(NONCE)}'\]\(\d+\)")
MAX_SOURCE: Final = 4096
"""Maximum length of a template, in characters."""
MAX_OUTPUT: Final = 65536
"""Maximum length of rendered text, in characters."""


_INSTEAD: Final = {
    "for": "; write {{ items | join(',') }} for a list",
    "if": "; write {{ 'a' if test else 'b' }}",
    "set": "; write the expression in place of the variable",
}
"""Hints for unsupported Jinja statements, by keyword."""


class ExpressionError(UrcError):
    """Raised if a template cannot be compiled or evaluated.

    `offset` is the 0-based character position of the error in the template.
    """

    def __init__(self, message: str, offset: int = 0) -> None:
        super().__init__(message)
        self.offset = offset


class Template:
    """A compiled, immutable template. Templates with equal Python source are equal."""

    __slots__ = ("_function", "is_constant", "names", "python", "settings", "source")

    def __init__(self, source: str, python: str, names: frozenset[str], settings: frozenset[str]):
        self.source = source
        """Source of the template, as in the document."""
        self.python = python
        """Python source of the expression, which reads all names from a mapping `ns`."""
        self.names = names
        """Root names in the expression, such as ``settings``, arguments and signals."""
        self.settings = settings
        """Names of the settings in the expression, from ``settings.NAME``."""
        self.is_constant = not names
        self._function: Callable[[Mapping[str, object]], Any] = _function(python)

    def evaluate(self, namespace: Mapping[str, object]) -> Any:
        """Return the value; raise `ExpressionError` for a missing name or an invalid operand."""
        try:
            value = self._function(namespace)
        except ExpressionError:
            raise
        except KeyError as error:
            raise ExpressionError(f"{error.args[0]!r} has no value here") from None
        except (ArithmeticError, TypeError, ValueError) as error:
            raise ExpressionError(f"in {self.source!r}: {error}") from None
        if isinstance(value, str) and len(value) > MAX_OUTPUT:
            raise ExpressionError(f"{self.source!r} produces more than {MAX_OUTPUT} characters")
        return value

    def render(self, namespace: Mapping[str, object]) -> str:
        """Return the value of the expression as text."""
        return text_of(self.evaluate(namespace))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Template) and other.python == self.python

    def __hash__(self) -> int:
        return hash(self.python)

    def __repr__(self) -> str:
        return f"Template({self.source!r})"


def compile_template(text: str) -> Template:
    """Compile a template, which is text with any number of ``{{ expression }}``.

    Raises:
        ExpressionError: the template is invalid; `offset` is the position of the error in `text`.
    """
    _check_length(text)
    parts: list[str] = []
    names: set[str] = set()
    settings: set[str] = set()
    for offset, literal, expression in split_template(text):
        if expression is None:
            parts.append(repr(literal))
        else:
            parts.append(_translate(expression, offset, names, settings))
    if len(parts) == 1:
        python = parts[0]
    elif parts:
        python = "_join(" + ", ".join(parts) + ")"
    else:
        python = "''"
    return Template(text, python, frozenset(names), frozenset(settings))


def compile_expression(text: str, *, allows_bytes: bool = False) -> Template:
    """Compile an expression without braces, as in ``when: battery > 20``.

    Args:
        text: the expression.
        allows_bytes: whether the expression's value may be bytes.
    """
    _check_length(text)
    if not text.strip():
        raise ExpressionError("expected an expression, found nothing")
    names: set[str] = set()
    settings: set[str] = set()
    python = _translate(text, 0, names, settings, allows_bytes=allows_bytes)
    return Template(text, python, frozenset(names), frozenset(settings))


def text_of(value: object) -> str:
    """Return the text form of `value`, as in templates."""
    if isinstance(value, bytes):
        raise ExpressionError("bytes are not text; send bytes with 'hex:' or 'bytes:'")
    return value if isinstance(value, str) else spelt(value)


def _check_length(text: str) -> None:
    if len(text) > MAX_SOURCE:
        raise ExpressionError(
            f"a template may have at most {MAX_SOURCE} characters, found {len(text)}"
        )


def _function(python: str) -> Callable[[Mapping[str, object]], Any]:
    try:
        code = compile(f"lambda ns: {python}", f"<template {python[:60]}>", "eval")
    except (SyntaxError, RecursionError, MemoryError):
        # The brackets around many long sums can exceed the nesting limit of the Python parser.
        raise ExpressionError("the expression is nested too deeply") from None
    # `python` contains only constants and names in SCOPE: see the warning in `urc._grammar`.
    function: Callable[[Mapping[str, object]], Any] = eval(code, table.SCOPE)  # noqa: S307
    return function


def split_template(text: str) -> Iterator[tuple[int, str, str | None]]:
    """Yield (offset, literal, None) or (offset, "", expression) for each part of a template."""
    position = 0
    while position < len(text):
        start = text.find("{", position)
        while start >= 0 and text[start : start + 2] not in ("{{", "{%", "{#"):
            start = text.find("{", start + 1)
        if start < 0:
            yield position, text[position:], None
            return
        if text[start : start + 2] != "{{":
            word = "statements" if text[start + 1] == "%" else "comments"
            instead = _INSTEAD.get(_word_behind(text, start), "")
            raise ExpressionError(
                f"{text[start : start + 2]!r}: templates have no {word}, only"
                f" {{{{ values }}}}{instead}",
                start,
            )
        if start > position:
            yield position, text[position:start], None
        end = _closing(text, start)
        yield start + 2, "", text[start + 2 : end]
        position = end + 2


def _word_behind(text: str, start: int) -> str:
    """Return the keyword of the Jinja statement at `start`."""
    return next(iter(text[start + 2 :].lstrip("-+ ").split(maxsplit=1)), "")


def _closing(text: str, start: int) -> int:
    """Return the offset of the ``}}`` that closes the ``{{`` at `start`."""
    quote = ""
    depth = 0
    position = start + 2
    while position < len(text):
        char = text[position]
        if quote:
            if char == "\\":
                position += 1
            elif char == quote:
                quote = ""
        elif char in "'\"":
            quote = char
        elif char == "{":
            depth += 1
        elif char == "}":
            if depth == 0 and text.startswith("}}", position):
                return position
            depth -= 1
        position += 1
    raise ExpressionError("'{{' is never closed by '}}'", start)


def _translate(
    text: str, offset: int, names: set[str], settings: set[str], *, allows_bytes: bool = False
) -> str:
    """Return the Python source for one expression; add its names to `names` and `settings`."""
    try:
        return translate(text, "ns[{!r}]".format, names, settings, allows_bytes=allows_bytes)
    except ExpressionSyntaxError as error:
        shown = text.strip()
        raise ExpressionError(f"in {shown!r}: {error}", offset + error.offset) from None


def last_filter(template: Template) -> str:
    """Return the name of an expression's outermost filter; "" if there is no filter."""
    name = template.python.partition("(")[0]
    return name.removeprefix("_filter_") if name.startswith("_filter_") else ""


def defaulted_names(template: Template) -> frozenset[str]:
    """Return the root names for which an expression always states a ``default``."""
    if "_filter_default(" not in template.python:
        return frozenset()
    needed, spare = set[str](), set[str]()
    _gather(ast.parse(template.python, mode="eval"), needed, spare, has_default=False)
    return frozenset(spare - needed)


def _gather(node: ast.AST, needed: set[str], spare: set[str], *, has_default: bool) -> None:
    """Add the root names under `node` to `needed`, or to `spare` if they have a default."""
    if isinstance(node, ast.Subscript) and ast.unparse(node.value) == "ns":
        (spare if has_default else needed).add(str(ast.literal_eval(node.slice)))
        return
    is_default = isinstance(node, ast.Call) and ast.unparse(node.func) == "_filter_default"
    for inner in ast.iter_child_nodes(node):
        within = has_default or (is_default and isinstance(inner, ast.Lambda))
        _gather(inner, needed, spare, has_default=within)


def digested_settings(template: Template) -> frozenset[str]:
    """Return the settings that an expression uses only in tests, or in hashes with a nonce or time.

    A hash with a nonce or time does not reveal a setting and cannot be replayed.
    """
    if not template.settings:
        return frozenset()
    shown, digested = set[str](), set[str]()
    _sort(ast.parse(template.python, mode="eval"), shown, digested, is_digested=False)
    return frozenset(digested - shown)


def _sort(node: ast.AST, shown: set[str], digested: set[str], *, is_digested: bool) -> None:
    """Add each setting under `node` to `digested` inside a hash or test, otherwise to `shown`."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        if node.func.id in _HASHES:
            roots = {one.value for one in ast.walk(node) if isinstance(one, ast.Constant)}
            is_new = {NONCE, NOW} & roots or any(str(one).startswith("_") for one in roots)
            is_digested = is_digested or bool(is_new)
        elif node.func.id in _SUMMARIES:
            is_digested = True
        elif node.func.id == "_item" and ast.unparse(node.args[0]) == "ns['settings']":
            (digested if is_digested else shown).add(ast.literal_eval(node.args[1]))
    for inner in ast.iter_child_nodes(node):
        # Comparisons and conditions reveal no more than a length.
        is_test = isinstance(node, ast.Compare) or inner is getattr(node, "test", None)
        _sort(inner, shown, digested, is_digested=is_digested or is_test)


def is_nonce(template: Template) -> bool:
    """Return whether an expression is only ``nonce()``."""
    return _NONCE.fullmatch(template.python) is not None


def is_byte_filter(name: str) -> bool:
    """Return whether the filter with this name returns bytes."""
    return name in table.FILTERS and table.FILTERS[name].gives_bytes

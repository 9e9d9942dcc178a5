"""Generated encoders: one function per command, which encodes arguments to bytes.

A generated encoder handles only the common case, in which every argument is a number of the
declared type. The ordinary encoder in `urc.protocol.requests.encode` handles all other cases. Tests
compare the generated encoders with the ordinary encoder. Templates of generated encoders may
contain only sums and products of numbers, and the filter ``fixed``.
"""

import ast
from collections.abc import Callable, Mapping
from typing import Final

from urc.expressions import Template, spelt
from urc.model.driver import Argument
from urc.model.payload import Payload
from urc.model.values import Reading
from urc.protocol.compile.source import function_of
from urc.protocol.framing.base import Framing
from urc.protocol.framing.delimited import DelimiterFraming

__all__ = ["build_fast_check", "build_fast_encode"]

Encode = Callable[[Mapping[str, object]], Payload]

_OPERATORS: Final[Mapping[str, ast.operator]] = {
    "_add": ast.Add(),
    "_sub": ast.Sub(),
    "_mul": ast.Mult(),
    "_div": ast.Div(),
}
_IN_NUMBERS: Final = frozenset(b"0123456789+-.einfa")
"""Bytes that may occur in the text of a number."""
_MOST_DIGITS: Final = 20
_LARGEST: Final = 1e308
"""Maximum value of an argument, as in `urc.protocol.requests.encode`."""


class _Unsupported(Exception):
    """The template contains an expression that cannot be translated to Python."""


def build_fast_encode(
    template: Template,
    arguments: Mapping[str, Argument],
    framing: Framing,
    encoding: str,
    slow: Encode,
) -> Encode | None:
    """Return a function that encodes a namespace to bytes; None if the template is unsupported."""
    if type(framing) is not DelimiterFraming or framing.codec is not None:
        return None
    names = sorted(template.names)
    kinds = {name: arguments[name].type for name in names if name in arguments}
    if not names or len(kinds) != len(names) or not {*kinds.values()} <= {"number", "integer"}:
        return None
    variables = {name: f"v{place}" for place, name in enumerate(names)}
    text = _text_of(template, kinds, variables, framing.tx, encoding)
    if text is None:
        return None
    lines = [f"    v{place} = ns[{name!r}]" for place, name in enumerate(names)]
    checks = [_check(f"v{place}", kinds[name]) for place, name in enumerate(names)]
    lines += [*_written(checks, text, encoding), "    return slow(ns)"]
    scope = {
        "ArithmeticError": ArithmeticError, "float": float, "int": int, "slow": slow,
        "spelt": spelt, "type": type,
    }  # fmt: skip
    return function_of("encode", "ns", lines, scope)


def _text_of(
    template: Template,
    kinds: Mapping[str, str],
    variables: Mapping[str, str],
    tx: bytes,
    encoding: str,
) -> str | None:
    """Return the format string of a frame as source text; None if the template is unsupported."""
    whole = frozenset(variables[name] for name, kind in kinds.items() if kind == "integer")
    try:
        pieces = _pieces(ast.parse(template.python, mode="eval").body, variables, whole)
        tail = _tail(pieces, tx, encoding)
    except (_Unsupported, UnicodeError):
        return None
    if tail:
        pieces.append(ast.Constant(tail))
    return ast.unparse(ast.fix_missing_locations(ast.JoinedStr(pieces)))


def _written(checks: list[str], text: str, encoding: str) -> list[str]:
    """Return source lines that return `text` as bytes if all `checks` are true."""
    return [
        f"    if {' and '.join(checks)}:",
        "        try:",
        f"            return {text}.encode({encoding!r})",
        "        except ArithmeticError:",
        "            pass",
    ]


def build_fast_check(
    arguments: Mapping[str, Argument], slow: Callable[[Mapping[str, object]], dict[str, Reading]]
) -> Callable[[Mapping[str, object]], dict[str, Reading]]:
    """Return a function that checks numeric arguments and calls `slow` in all other cases."""
    kinds = {one.type for one in arguments.values()}
    if not arguments or kinds - {"number", "integer"}:
        return slow
    if any(one.choices for one in arguments.values()):
        return slow
    lines = [f"    if len(given) == {len(arguments)}:", "        try:"]
    lines += [f"            v{place} = given[{name!r}]" for place, name in enumerate(arguments)]
    lines += ["        except KeyError:", "            return slow(given)"]
    checks = [_range(f"v{place}", one) for place, one in enumerate(arguments.values())]
    values = ", ".join(f"{name!r}: v{place}" for place, name in enumerate(arguments))
    lines += [f"        if {' and '.join(checks)}:", f"            return {{{values}}}"]
    lines.append("    return slow(given)")
    scope = {
        "KeyError": KeyError, "float": float, "int": int, "len": len, "slow": slow, "type": type,
    }  # fmt: skip
    return function_of("check", "given", lines, scope)


def _range(variable: str, argument: Argument) -> str:
    """Return source text that checks whether a variable contains a valid value of the argument."""
    low = -_LARGEST if argument.min is None else argument.min
    high = _LARGEST if argument.max is None else argument.max
    whole = f"type({variable}) is int"
    kind = whole if argument.type == "integer" else f"(type({variable}) is float or {whole})"
    return f"{kind} and {low!r} <= {variable} <= {high!r}"


def _check(variable: str, kind: str) -> str:
    # Larger whole numbers go to the closures, which bound intermediate results.
    whole = f"type({variable}) is int and -4611686018427387904 < {variable} < 4611686018427387904"
    return f"({whole})" if kind == "integer" else f"(type({variable}) is float or {whole})"


def _tail(pieces: list[ast.expr], tx: bytes, encoding: str) -> str:
    """Return the delimiter as text; raise `_Unsupported` if the frame content may contain it."""
    literals = [one.value for one in pieces if isinstance(one, ast.Constant)]
    texts = [text.encode(encoding) for text in literals if isinstance(text, str)]
    if any(tx and tx in text for text in texts) or not _IN_NUMBERS.isdisjoint(tx):
        raise _Unsupported
    tail = tx.decode(encoding)
    if tail.encode(encoding) != tx:
        raise _Unsupported
    return tail


def _pieces(node: ast.expr, variables: Mapping[str, str], whole: frozenset[str]) -> list[ast.expr]:
    """Return the parts of a format string: literal text and numbers."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return [node]
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        if node.func.id == "_join":
            return [piece for part in node.args for piece in _pieces(part, variables, whole)]
        if node.func.id == "_filter_fixed" and len(node.args) == 2:
            subject, digits = node.args
            if isinstance(digits, ast.Constant) and type(digits.value) is int:
                if not 0 <= digits.value <= _MOST_DIGITS:
                    raise _Unsupported
                form = ast.JoinedStr([ast.Constant(f".{digits.value}f")])
                return [ast.FormattedValue(_number(subject, variables), -1, form)]
    number = _number(node, variables)
    if not (isinstance(number, ast.Name) and number.id in whole):
        number = ast.Call(ast.Name("spelt"), [number], [])
    return [ast.FormattedValue(number, -1, None)]


def _number(node: ast.expr, variables: Mapping[str, str]) -> ast.expr:
    """Return a Python expression for a number, using arguments, constants, sums and products."""
    if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant):
        return ast.Name(variables[str(node.slice.value)])  # only `ns[NAME]` has this form
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return node
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        operator = _OPERATORS.get(node.func.id)
        if operator is not None and len(node.args) == 2:
            left, right = (_number(one, variables) for one in node.args)
            return ast.BinOp(left, operator, right)
    raise _Unsupported

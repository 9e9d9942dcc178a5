"""Translates expressions in the supported subset of Jinja into Python source.

Private to `urc.expressions`. Grammar and precedence follow the section "Expressions" in Jinja's
template designer documentation. A custom parser can report the column of every error, and avoids
the 40 ms import of a template engine. `tests/unit/test_expressions.py` compares this parser with
Jinja.

WARNING: the generated Python source is passed to eval. The source may contain only the `repr()` of
constants, results of `resolve`, and names in `urc.filters.table.SCOPE`.
"""

import math
import re
from collections.abc import Callable
from typing import Final

from urc._tokens import ExpressionSyntaxError, Token, float_of, integer_of, string_of, tokens_of
from urc.filters import table
from urc.filters.lists import compiled
from urc.problems import UrcError

__all__ = ["COUNTERS", "MAX_DEPTH", "NONCE", "ExpressionSyntaxError", "translate"]

MAX_DEPTH: Final = 40
"""Maximum nesting depth, and maximum number of consecutive operators of one kind."""

_CONSTANTS = {
    "true": "True",
    "True": "True",
    "false": "False",
    "False": "False",
    "none": "None",
    "None": "None",
    "pi": repr(math.pi),
}
_KEYWORDS = frozenset(("and", "or", "not", "in", "is", "if", "else"))
_COMPARE = frozenset(("==", "!=", "<", "<=", ">", ">="))
_SUM = {"+": "_add", "-": "_sub"}
_PRODUCT = {"*": "_mul", "/": "_div", "//": "_floordiv", "%": "_mod"}
_TESTS = (
    "defined", "undefined", "none", "odd", "even", "number", "string", "match", "search", "in",
)  # fmt: skip
_PATTERNS = ("match", "search")
COUNTERS: Final = "seq()"
"""Name of the counters in an expression's namespace; documents cannot use this name."""
NONCE: Final = "nonce()"
"""Name of the nonce in an expression's namespace; documents cannot use this name."""
_MOST_NONCE: Final = 64
_NONCE_ALONE = re.compile(r"\(\d+\)")
_COUNTER = re.compile(r"[a-z][a-z0-9_]{0,63}")


def translate(
    text: str,
    resolve: Callable[[str], str],
    names: set[str],
    settings: set[str],
    *,
    allows_bytes: bool = False,
) -> str:
    """Return the Python source for the expression `text`.

    Args:
        text: an expression without braces.
        resolve: function that returns the Python source for reading a root name.
        names: set that receives the root names in the expression.
        settings: set that receives the names of settings, from ``settings.NAME``.
        allows_bytes: whether the expression's value may be bytes.

    Raises:
        ExpressionSyntaxError: the text is not a valid expression.
    """
    parser = _ExpressionParser(tokens_of(text), resolve, names, settings)
    parser.allows_bytes = allows_bytes
    python = parser.expression()
    parser.expect_end()
    if not allows_bytes and _NONCE_ALONE.fullmatch(python.removeprefix(resolve(NONCE))):
        text = (
            "nonce() returns bytes: write nonce() | b64encode, or send it with 'hex:' or 'bytes:'"
        )
        raise ExpressionSyntaxError(text, 0)
    return python


class _ExpressionParser:
    """A recursive descent parser with one method per precedence level, lowest precedence first."""

    def __init__(
        self,
        tokens: list[Token],
        resolve: Callable[[str], str],
        names: set[str],
        settings: set[str],
    ) -> None:
        self._tokens = tokens
        self._place = 0
        self._depth = 0
        self._resolve = resolve
        self._names = names
        self._settings = settings
        self.allows_bytes = False
        """Whether the last filter in the expression may return bytes."""

    def expression(self) -> str:
        """Parse ``a if test else b``, and all operators with higher precedence."""
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise ExpressionSyntaxError("the expression is nested too deeply", self._next.offset)
        value = self._or()
        if self._accept("if"):
            test = self._or()
            if not self._accept("else"):
                raise ExpressionSyntaxError("'… if …' needs an 'else'", self._next.offset)
            value = f"({value} if {test} else {self.expression()})"
        self._depth -= 1
        return value

    def expect_end(self) -> None:
        """Raise an error if any text follows the expression."""
        if self._next.kind != "end":
            raise self._surprise()

    @property
    def _next(self) -> Token:
        return self._tokens[self._place]

    def _advance(self) -> Token:
        token = self._tokens[self._place]
        self._place += 1
        return token

    def _accept(self, text: str) -> bool:
        """Skip the next token if it is `text` outside quotes; return whether it was skipped."""
        if self._next.text == text and self._next.kind in ("operator", "name"):
            self._place += 1
            return True
        return False

    def _expect(self, text: str) -> None:
        if not self._accept(text):
            raise self._surprise(f"; {text!r} is expected")

    def _surprise(self, expected: str = "") -> ExpressionSyntaxError:
        token = self._next
        if token.kind == "end":
            return ExpressionSyntaxError(f"the expression ends too early{expected}", token.offset)
        return ExpressionSyntaxError(f"{token.text!r} is not expected here{expected}", token.offset)

    def _or(self) -> str:
        value = self._and()
        while self._accept("or"):
            value = f"({value} or {self._and()})"
        return value

    def _and(self) -> str:
        value = self._not()
        while self._accept("and"):
            value = f"({value} and {self._not()})"
        return value

    def _not(self) -> str:
        count = 0
        while self._accept("not"):
            count += 1
        value = self._comparison()
        return f"({'not ' * min(count, MAX_DEPTH)}{value})" if count else value

    def _comparison(self) -> str:
        parts = [self._sum()]
        while True:
            token = self._next
            if token.kind == "operator" and token.text in _COMPARE:
                parts += [self._advance().text, self._sum()]
            elif self._accept("in"):
                parts += ["in", self._sum()]
            elif token.text == "not" and self._tokens[self._place + 1].text == "in":
                self._place += 2
                parts += ["not in", self._sum()]
            else:
                return "(" + " ".join(parts) + ")" if len(parts) > 1 else parts[0]

    def _sum(self) -> str:
        return self._binary(self._concatenation, _SUM)

    def _concatenation(self) -> str:
        parts = [self._product()]
        while self._accept("~"):
            parts.append(self._product())
        return f"_join({', '.join(parts)})" if len(parts) > 1 else parts[0]

    def _product(self) -> str:
        return self._binary(self._power, _PRODUCT)

    def _power(self) -> str:
        return self._binary(self._unary, {"**": "_pow"})

    def _binary(self, tighter: Callable[[], str], operators: dict[str, str]) -> str:
        value = tighter()
        levels = 0
        while self._next.kind == "operator" and self._next.text in operators:
            levels += 1
            if levels > MAX_DEPTH:
                raise ExpressionSyntaxError("the expression is too long", self._next.offset)
            function = operators[self._advance().text]
            value = f"{function}({value}, {tighter()})"
        return value

    def _unary(self) -> str:
        return self._filtered(self._signed())

    def _signed(self) -> str:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise ExpressionSyntaxError("the expression is nested too deeply", self._next.offset)
        if self._accept("-"):
            value = f"_sub(0, {self._signed()})"
        elif self._accept("+"):
            value = f"_add(0, {self._signed()})"
        else:
            value = self._postfix()
        self._depth -= 1
        return value

    def _postfix(self) -> str:
        is_settings = self._next == Token("name", "settings", self._next.offset)
        value = self._primary()
        while True:
            if self._accept("."):
                value = f"_item({value}, {self._key(is_settings)})"
            elif self._accept("["):
                value = self._subscript(value, is_settings)
            elif self._next.text == "(" and self._next.kind == "operator":
                text = "function calls are not supported, except filters, seq() and nonce()"
                raise ExpressionSyntaxError(text, self._next.offset)
            else:
                return value
            is_settings = False

    def _key(self, is_settings: bool) -> str:
        token = self._advance()
        if token.kind == "integer":
            return integer_of(token)
        if token.kind != "name":
            raise ExpressionSyntaxError("a name is expected after the dot", token.offset)
        if is_settings:
            self._settings.add(token.text)
        return repr(token.text)

    def _subscript(self, value: str, is_settings: bool) -> str:
        """Parse ``[key]``, or a slice such as ``[1:3]``."""
        token = self._next
        key = "None" if token.text == ":" and token.kind == "operator" else self.expression()
        if self._accept(":"):
            stop = "None" if self._next.text == "]" else self.expression()
            if self._next.text == ":":
                raise ExpressionSyntaxError(
                    "a slice may have a start and an end, but no step", self._next.offset
                )
            self._expect("]")
            return f"_slice({value}, {key}, {stop})"
        if is_settings and token.kind == "string" and self._next.text == "]":
            self._settings.add(string_of(token))
        self._expect("]")
        return f"_item({value}, {key})"

    def _primary(self) -> str:
        token = self._advance()
        if token.kind == "integer":
            return integer_of(token)
        if token.kind == "float":
            return float_of(token)
        if token.kind == "string":
            return repr(string_of(token))
        if token.kind == "name" and token.text not in _KEYWORDS:
            if token.text in _CONSTANTS:
                return _CONSTANTS[token.text]
            if token.text == "seq" and self._accept("("):
                return self._counter(token)
            if token.text == "nonce" and self._accept("("):
                return self._nonce(token)
            self._names.add(token.text)
            return self._resolve(token.text)
        if token.text == "(" and token.kind == "operator":
            value = self.expression()
            self._expect(")")
            return value
        if token.text == "[" and token.kind == "operator":
            return f"[{', '.join(self._items(']'))}]"
        self._place -= 1
        raise self._surprise()

    def _counter(self, token: Token) -> str:
        """Parse ``seq('name', low, high)``, the next number of a counter."""
        name, low, high = self._next, None, None
        self._place += 1
        if name.kind != "string" or not _COUNTER.fullmatch(string_of(name)):
            raise ExpressionSyntaxError(
                "the first argument of 'seq' must be a name in quotes, such as 'id'", name.offset
            )
        if self._accept(","):
            low = self._whole()
        if low is not None and self._accept(","):
            high = self._whole()
        if low is None or high is None or not self._accept(")"):
            raise ExpressionSyntaxError(
                "write seq('name', lowest, highest) with whole numbers", token.offset
            )
        if not 0 <= low < high < 1 << 64:
            raise ExpressionSyntaxError(f"a counter cannot run from {low} to {high}", token.offset)
        self._names.add(COUNTERS)
        return f"{self._resolve(COUNTERS)}({string_of(name)!r}, {low}, {high})"

    def _nonce(self, token: Token) -> str:
        """Parse ``nonce()`` or ``nonce(8)``; the argument is a number of bytes, by default 16."""
        size = 16 if self._next.text == ")" else self._whole()
        if size is None or not self._accept(")"):
            raise ExpressionSyntaxError(
                "write nonce(), or nonce(8) with a number of bytes", token.offset
            )
        if not 1 <= size <= _MOST_NONCE:
            raise ExpressionSyntaxError(
                f"a nonce has 1 to {_MOST_NONCE} bytes, not {size}", token.offset
            )
        self._names.add(NONCE)
        return f"{self._resolve(NONCE)}({size})"

    def _whole(self) -> int | None:
        token = self._next
        if token.kind != "integer":
            return None
        self._place += 1
        return int(integer_of(token))

    def _items(self, closing: str) -> list[str]:
        items: list[str] = []
        while not self._accept(closing):
            if items:
                self._expect(",")
                if self._accept(closing):
                    break
            items.append(self.expression())
        return items

    def _filtered(self, value: str) -> str:
        while True:
            if self._accept("|"):
                value = self._filter(value)
            elif self._accept("is"):
                value = self._test(value)
            else:
                return value

    def _pattern(self, test: Token) -> str:
        """Parse and compile the pattern in ``match('...')`` or ``search('...')``."""
        self._expect("(")
        token = self._advance()
        if token.kind != "string":
            raise ExpressionSyntaxError(
                f"the argument of {test.text!r} must be a pattern in quotes", token.offset
            )
        source = token.text[1:-1]  # unchanged: a backslash belongs to the pattern
        self._expect(")")
        try:
            compiled(source, test.text)
        except UrcError as error:
            raise ExpressionSyntaxError(str(error), token.offset) from None
        return source

    def _filter(self, subject: str) -> str:
        token = self._advance()
        if token.kind != "name" or token.text not in table.FILTERS:
            known = table.filter_names()
            raise ExpressionSyntaxError(
                f"there is no filter {token.text!r}; the filters are: {known}", token.offset
            )
        has_arguments = self._accept("(")
        first = self._next
        arguments = self._items(")") if has_arguments else []
        self._check_word(token.text, first, arguments)
        least, most = table.FILTERS[token.text].arity
        if not least <= len(arguments) <= most:
            expected = str(least) if least == most else f"{least} to {most}"
            text = f"filter {token.text!r} takes {expected} arguments, found {len(arguments)}"
            raise ExpressionSyntaxError(text, token.offset)
        is_last = self._next.text != "|"
        if table.FILTERS[token.text].gives_bytes and is_last and not self.allows_bytes:
            text = f"{token.text!r} returns bytes, which only 'hex:' and 'bytes:' can send"
            raise ExpressionSyntaxError(text, token.offset)
        if token.text == "default":
            # The subject may be a missing name, so this filter evaluates its subject itself.
            subject = f"lambda: {subject}"
        return f"_filter_{token.text}({', '.join((subject, *arguments))})"

    def _check_word(self, name: str, first: Token, arguments: list[str]) -> None:
        """Raise an error for a constant argument that is invalid for the filter `name`."""
        refuses = table.FILTERS[name].refuses
        if refuses is None or first.kind != "string" or not arguments:
            return
        word = string_of(first)
        wrong = refuses(word) if arguments[0] == repr(word) else ""
        if wrong:
            raise ExpressionSyntaxError(f"{name!r}: {wrong}", first.offset)

    def _test(self, subject: str) -> str:
        is_negated = self._accept("not")
        token = self._advance()
        if token.kind != "name" or token.text not in _TESTS:
            known = ", ".join(_TESTS)
            raise ExpressionSyntaxError(
                f"there is no test {token.text!r}; the tests are: {known}", token.offset
            )
        if token.text in ("defined", "undefined"):
            python = f"_is_defined(lambda: {subject})"
            is_negated ^= token.text == "undefined"
        elif token.text in _PATTERNS:
            python = f"_{token.text}({subject}, {self._pattern(token)!r})"
        elif token.text == "in":
            python = f"({subject} in {self._unary()})"
        elif token.text in ("number", "string", "none"):
            python = f"_is_{token.text}({subject})"
        else:
            python = f"(_mod({subject}, 2) == {int(token.text == 'odd')})"
        return f"(not {python})" if is_negated else python

"""The grammar of expressions: text → Python source, for the forms that documents may use.

Floor 1, private to `urc.expressions`. The grammar and its precedence are Jinja's (its template
designer documentation, "Expressions"), read by a parser of our own: every fault has its column, and
no command pays 40 ms for importing a template engine. `tests/unit/test_expressions.py` holds both
together, Jinja being the oracle.

WARNING: the result is passed to eval. Everything put into it is a repr() of a constant, the text
that `resolve` returns, or a name out of `urc._filters.SCOPE`; keep it so.
"""

import re
from collections.abc import Callable
from typing import Final, NamedTuple

from urc import _filters

__all__ = ["MAX_DEPTH", "Refused", "translate"]

MAX_DEPTH: Final = 40
"""Levels of brackets, and operators of one kind in a row."""

_TOKEN = re.compile(
    r"""(?P<space>\s+)
    |(?P<float>\d[\d_]*(?:\.\d[\d_]*(?:[eE][+-]?\d+)?|[eE][+-]?\d+))
    |(?P<integer>0[xX][0-9a-fA-F_]+|0[bB][01_]+|0[oO][0-7_]+|\d[\d_]*)
    |(?P<name>[A-Za-z_][A-Za-z0-9_]*)
    |(?P<string>'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*")
    |(?P<operator>\*\*|//|==|!=|<=|>=|[-+*/%~<>|.,()\[\]])""",
    re.VERBOSE | re.DOTALL | re.ASCII,
)
_ESCAPE = re.compile(r"\\(?:x([0-9a-fA-F]{2})|u([0-9a-fA-F]{4})|(.))", re.DOTALL)
_ESCAPES = {"n": "\n", "r": "\r", "t": "\t", "0": "\0", "\\": "\\", "'": "'", '"': '"'}
_CONSTANTS = {
    "true": "True",
    "True": "True",
    "false": "False",
    "False": "False",
    "none": "None",
    "None": "None",
}
_KEYWORDS = frozenset(("and", "or", "not", "in", "is", "if", "else"))
_COMPARE = frozenset(("==", "!=", "<", "<=", ">", ">="))
_SUM = {"+": "_add", "-": "_sub"}
_PRODUCT = {"*": "_mul", "/": "_div", "//": "_floordiv", "%": "_mod"}
_TESTS = ("defined", "undefined", "none", "odd", "even")
_MAX_DIGITS = 400


class Refused(Exception):
    """Why this text is no expression of the language, and the 0-based character of the fault."""

    def __init__(self, message: str, offset: int) -> None:
        super().__init__(message)
        self.offset = offset


class _Token(NamedTuple):
    kind: str
    text: str
    offset: int


def translate(text: str, resolve: Callable[[str], str], names: set[str], settings: set[str]) -> str:
    """Return Python for the expression `text`.

    Args:
        text: without braces.
        resolve: root name → the Python that reads it.
        names: takes the root names used.
        settings: takes every NAME of ``settings.NAME``.

    Raises:
        Refused: it is no expression of the language.
    """
    parser = _Parser(_tokens(text), resolve, names, settings)
    python = parser.expression()
    parser.expect_end()
    return python


def _tokens(text: str) -> list[_Token]:
    tokens: list[_Token] = []
    position = 0
    while position < len(text):
        found = _TOKEN.match(text, position)
        if found is None or found.lastgroup is None:
            raise Refused(_unreadable(text[position]), position)
        if found.lastgroup != "space":
            tokens.append(_Token(found.lastgroup, found[0], position))
        position = found.end()
    return [*tokens, _Token("end", "", len(text.rstrip()))]


def _unreadable(character: str) -> str:
    if character in "'\"":
        return f"the quote {character} is never closed"
    if character in "{}":
        return "braces are not part of an expression"
    return f"{character!r} is not part of an expression"


class _Parser:
    """Recursive descent, one method per level of precedence, from the loosest to the tightest."""

    def __init__(
        self,
        tokens: list[_Token],
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

    def expression(self) -> str:
        """``a if test else b``, and everything tighter."""
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise Refused("the expression is nested too deeply", self._next.offset)
        value = self._or()
        if self._take("if"):
            test = self._or()
            if not self._take("else"):
                raise Refused("'… if …' needs an 'else'", self._next.offset)
            value = f"({value} if {test} else {self.expression()})"
        self._depth -= 1
        return value

    def expect_end(self) -> None:
        """Complain about whatever follows the expression."""
        if self._next.kind != "end":
            raise self._surprise()

    @property
    def _next(self) -> _Token:
        return self._tokens[self._place]

    def _advance(self) -> _Token:
        token = self._tokens[self._place]
        self._place += 1
        return token

    def _take(self, text: str) -> bool:
        """Step over `text` when it is next; strings do not count as the word they hold."""
        if self._next.text == text and self._next.kind in ("operator", "name"):
            self._place += 1
            return True
        return False

    def _expect(self, text: str) -> None:
        if not self._take(text):
            raise self._surprise(f"; {text!r} is expected")

    def _surprise(self, expected: str = "") -> Refused:
        token = self._next
        if token.kind == "end":
            return Refused(f"the expression ends too early{expected}", token.offset)
        return Refused(f"{token.text!r} is not expected here{expected}", token.offset)

    def _or(self) -> str:
        value = self._and()
        while self._take("or"):
            value = f"({value} or {self._and()})"
        return value

    def _and(self) -> str:
        value = self._not()
        while self._take("and"):
            value = f"({value} and {self._not()})"
        return value

    def _not(self) -> str:
        count = 0
        while self._take("not"):
            count += 1
        value = self._comparison()
        return f"({'not ' * min(count, MAX_DEPTH)}{value})" if count else value

    def _comparison(self) -> str:
        parts = [self._sum()]
        while True:
            token = self._next
            if token.kind == "operator" and token.text in _COMPARE:
                parts += [self._advance().text, self._sum()]
            elif self._take("in"):
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
        while self._take("~"):
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
                raise Refused("the expression is too long", self._next.offset)
            function = operators[self._advance().text]
            value = f"{function}({value}, {tighter()})"
        return value

    def _unary(self) -> str:
        return self._filtered(self._signed())

    def _signed(self) -> str:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise Refused("the expression is nested too deeply", self._next.offset)
        if self._take("-"):
            value = f"_sub(0, {self._signed()})"
        elif self._take("+"):
            value = f"_add(0, {self._signed()})"
        else:
            value = self._postfix()
        self._depth -= 1
        return value

    def _postfix(self) -> str:
        is_settings = self._next == _Token("name", "settings", self._next.offset)
        value = self._primary()
        while True:
            if self._take("."):
                value = f"_item({value}, {self._key(is_settings)})"
            elif self._take("["):
                value = f"_item({value}, {self._subscript(is_settings)})"
            elif self._next.text == "(" and self._next.kind == "operator":
                raise Refused("calls are not part of the language, only filters", self._next.offset)
            else:
                return value
            is_settings = False

    def _key(self, is_settings: bool) -> str:
        token = self._advance()
        if token.kind == "integer":
            return _integer(token)
        if token.kind != "name":
            raise Refused("a name is expected after the dot", token.offset)
        if is_settings:
            self._settings.add(token.text)
        return repr(token.text)

    def _subscript(self, is_settings: bool) -> str:
        token = self._next
        key = self.expression()
        if is_settings and token.kind == "string" and self._next.text == "]":
            self._settings.add(_string(token))
        self._expect("]")
        return key

    def _primary(self) -> str:
        token = self._advance()
        if token.kind == "integer":
            return _integer(token)
        if token.kind == "float":
            return _float(token)
        if token.kind == "string":
            return repr(_string(token))
        if token.kind == "name" and token.text not in _KEYWORDS:
            if token.text in _CONSTANTS:
                return _CONSTANTS[token.text]
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

    def _items(self, closing: str) -> list[str]:
        items: list[str] = []
        while not self._take(closing):
            if items:
                self._expect(",")
                if self._take(closing):
                    break
            items.append(self.expression())
        return items

    def _filtered(self, value: str) -> str:
        while True:
            if self._take("|"):
                value = self._filter(value)
            elif self._take("is"):
                value = self._test(value)
            else:
                return value

    def _filter(self, subject: str) -> str:
        token = self._advance()
        if token.kind != "name" or token.text not in _filters.FILTERS:
            known = _filters.filter_names()
            raise Refused(f"there is no filter {token.text!r}; there are: {known}", token.offset)
        arguments = self._items(")") if self._take("(") else []
        least, most = _filters.FILTERS[token.text].arity
        if not least <= len(arguments) <= most:
            expected = str(least) if least == most else f"{least} to {most}"
            text = f"filter {token.text!r} takes {expected} arguments, found {len(arguments)}"
            raise Refused(text, token.offset)
        if token.text == "default":
            # The only filter that may meet a missing name, so its subject is evaluated inside it.
            subject = f"lambda: {subject}"
        return f"_filter_{token.text}({', '.join((subject, *arguments))})"

    def _test(self, subject: str) -> str:
        is_negated = self._take("not")
        token = self._advance()
        if token.kind != "name" or token.text not in _TESTS:
            known = ", ".join(_TESTS)
            raise Refused(f"there is no test {token.text!r}; there are: {known}", token.offset)
        if token.text in ("defined", "undefined"):
            python = f"_is_defined(lambda: {subject})"
            is_negated ^= token.text == "undefined"
        elif token.text == "none":
            python = f"({subject} is None)"
        else:
            python = f"(_mod({subject}, 2) == {int(token.text == 'odd')})"
        return f"(not {python})" if is_negated else python


def _integer(token: _Token) -> str:
    text = token.text
    if len(text) > _MAX_DIGITS:
        raise Refused("the number is too large", token.offset)
    try:
        # "010" is ten in some languages and eight in others; in this one it is a mistake.
        return repr(int(text, 0))
    except ValueError:
        raise Refused(f"{text!r} is not a number", token.offset) from None


def _float(token: _Token) -> str:
    try:
        value = float(token.text)
    except ValueError:
        raise Refused(f"{token.text!r} is not a number", token.offset) from None
    if value == float("inf"):
        raise Refused("the number is too large", token.offset)
    return repr(value)


def _string(token: _Token) -> str:
    def character(found: re.Match[str]) -> str:
        code = found[1] or found[2]
        if code:
            return chr(int(code, 16))
        if found[3] not in _ESCAPES:
            text = f"'\\{found[3]}' is no escape in an expression"
            raise Refused(text, token.offset + 1 + found.start())
        return _ESCAPES[found[3]]

    return _ESCAPE.sub(character, token.text[1:-1])

"""Splits expressions into tokens, and converts number and text tokens to constants.

Private to `urc._grammar`.
"""

import re
from typing import Final, NamedTuple

__all__ = ["ExpressionSyntaxError", "Token", "float_of", "integer_of", "string_of", "tokens_of"]

_TOKEN = re.compile(
    r"""(?P<space>\s+)
    |(?P<float>\d[\d_]*(?:\.\d[\d_]*(?:[eE][+-]?\d+)?|[eE][+-]?\d+))
    |(?P<integer>0[xX][0-9a-fA-F_]+|0[bB][01_]+|0[oO][0-7_]+|\d[\d_]*)
    |(?P<name>[A-Za-z_][A-Za-z0-9_]*)
    |(?P<string>'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*")
    |(?P<operator>\*\*|//|==|!=|<=|>=|[-+*/%~<>|.,:()\[\]])""",
    re.VERBOSE | re.DOTALL | re.ASCII,
)
_ESCAPE = re.compile(r"\\(?:x([0-9a-fA-F]{2})|u([0-9a-fA-F]{4})|(.))", re.DOTALL)
_ESCAPES = {"n": "\n", "r": "\r", "t": "\t", "0": "\0", "\\": "\\", "'": "'", '"': '"'}
_MAX_DIGITS: Final = 400


class ExpressionSyntaxError(Exception):
    """An invalid expression, with the 0-based character position of the error."""

    def __init__(self, message: str, offset: int) -> None:
        super().__init__(message)
        self.offset = offset


class Token(NamedTuple):
    kind: str
    text: str
    offset: int


def tokens_of(text: str) -> list[Token]:
    tokens: list[Token] = []
    position = 0
    while position < len(text):
        found = _TOKEN.match(text, position)
        if found is None or found.lastgroup is None:
            raise ExpressionSyntaxError(_unreadable(text[position]), position)
        if found.lastgroup != "space":
            tokens.append(Token(found.lastgroup, found[0], position))
        position = found.end()
    return [*tokens, Token("end", "", len(text.rstrip()))]


def _unreadable(character: str) -> str:
    if character in "'\"":
        return f"the quote {character} is never closed"
    if character in "{}":
        return "braces are not allowed in an expression"
    return f"{character!r} is not allowed in an expression"


def integer_of(token: Token) -> str:
    text = token.text
    if len(text) > _MAX_DIGITS:
        raise ExpressionSyntaxError("the number is too large", token.offset)
    try:
        # "010" means ten in some languages and eight in others; here it is an error.
        return repr(int(text, 0))
    except ValueError:
        raise ExpressionSyntaxError(f"{text!r} is not a number", token.offset) from None


def float_of(token: Token) -> str:
    try:
        value = float(token.text)
    except ValueError:
        raise ExpressionSyntaxError(f"{token.text!r} is not a number", token.offset) from None
    if value == float("inf"):
        raise ExpressionSyntaxError("the number is too large", token.offset)
    return repr(value)


def string_of(token: Token) -> str:
    def character(found: re.Match[str]) -> str:
        code = found[1] or found[2]
        if code:
            return chr(int(code, 16))
        if found[3] not in _ESCAPES:
            text = f"'\\{found[3]}' is not a valid escape in an expression"
            raise ExpressionSyntaxError(text, token.offset + 1 + found.start())
        return _ESCAPES[found[3]]

    return _ESCAPE.sub(character, token.text[1:-1])

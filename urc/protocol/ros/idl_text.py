"""Definitions in ``.idl`` text, as sent by robots (``ros2idl``).

Pure. The module reads the subset of OMG IDL 4.2 that rosidl uses: modules, structures, typedefs,
constants, enumerations and annotations.
"""

import re
from typing import Final

from urc.problems import printable
from urc.protocol.ros.definition import (
    MAX_DEPTH,
    MAX_FIXED,
    BadDefinition,
    Definition,
    Definitions,
    MessageField,
    plain_name,
)
from urc.protocol.ros.msg_text import split_types

__all__ = ["parse_idl"]

_TOKEN: Final = re.compile(
    r"""\s+|//[^\n]*|\#[^\n]*"""
    r"""|(?P<text>"(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*')"""
    r"""|(?P<word>[A-Za-z_][A-Za-z0-9_]*(?:::[A-Za-z_][A-Za-z0-9_]*)*)"""
    r"""|(?P<number>[+-]?[0-9.][0-9A-Za-z.]*(?:(?<=[eE])[+-][0-9]+)?)"""
    r"""|(?P<sign>[{}()<>\[\];,:=@|+\-*/&~^%])""",
    re.DOTALL,
)
_PRIMITIVES: Final = {
    "boolean": "bool", "octet": "octet", "char": "char", "wchar": "uint16",
    "int8": "int8", "uint8": "uint8", "int16": "int16", "uint16": "uint16",
    "int32": "int32", "uint32": "uint32", "int64": "int64", "uint64": "uint64",
    "short": "int16", "long": "int32", "long long": "int64",
    "unsigned short": "uint16", "unsigned long": "uint32", "unsigned long long": "uint64",
    "float": "float32", "double": "float64", "string": "string", "wstring": "wstring",
}  # fmt: skip


def parse_idl(name: str, text: str) -> Definitions:
    """Return the definitions in ``.idl`` text.

    Args:
        name: name of the main type, in any form.
        text: definitions of all types, separated as in ``ros2msg`` text, with ``IDL:`` before each
            name.

    Raises:
        BadDefinition: the text is invalid.
    """
    found: dict[str, Definition] = {}
    for inner, part in split_types(name, text, "IDL:"):
        for one in _Parser(inner, part).parse():
            found.setdefault(one.name, one)
    return found


class _Type:
    """A parsed type reference, independent of any field."""

    __slots__ = ("bound", "length", "name")

    def __init__(self, name: str, length: int | None = None, bound: int | None = None) -> None:
        self.name, self.length, self.bound = name, length, bound


class _Parser:
    def __init__(self, owner: str, text: str) -> None:
        self._owner = owner
        self._tokens = self._cut(text)
        self._at = 0
        self._typedefs: dict[str, _Type] = {}
        self._found: list[Definition] = []

    def _cut(self, text: str) -> list[str]:
        tokens, at = [], 0
        while at < len(text):
            if text.startswith("/*", at):
                at = text.find("*/", at + 2) + 2
                if at < 2:
                    raise self._bad("/*")
                continue
            match = _TOKEN.match(text, at)
            if match is None:
                raise self._bad(text[at : at + 20])
            if match.lastgroup:
                tokens.append(match.group())
            at = match.end()
        return tokens

    def _bad(self, word: str) -> BadDefinition:
        return BadDefinition(f"{self._owner}: unexpected {printable(word)!r} in the IDL text")

    def parse(self) -> list[Definition]:
        while self._at < len(self._tokens):
            self._item((), 0)
        return self._found

    # -- tokens

    def _peek(self) -> str:
        return self._tokens[self._at] if self._at < len(self._tokens) else ""

    def _take(self, wanted: str = "") -> str:
        word = self._peek()
        if not word or (wanted and word != wanted):
            raise self._bad(word or "the end")
        self._at += 1
        return word

    def _skip(self, *ends: str) -> list[str]:
        """Skip to the first token outside brackets that is in `ends`; return the skipped tokens."""
        depth, start = 0, self._at
        while depth or self._peek() not in ends:
            word = self._take()
            depth += (word in "([{") - (word in ")]}")
        return self._tokens[start : self._at]

    # -- grammar

    def _item(self, modules: tuple[str, ...], depth: int) -> None:
        if depth > MAX_DEPTH:
            raise BadDefinition(f"{self._owner}: too many nested modules")
        self._annotations()
        match self._take():
            case "module":
                inner = (*modules, self._take())
                self._take("{")
                while self._peek() != "}":
                    self._item(inner, depth + 1)
                self._take("}")
            case "struct":
                self._struct(modules)
            case "typedef":
                kind = self._type()
                for name, length in self._names():
                    self._typedefs[name] = _Type(kind.name, length or kind.length, kind.bound)
            case "enum":
                self._typedefs[self._take()] = _Type("uint32")
                self._skip(";")
            case "const" | "union" | "bitmask" | "bitset":
                self._skip(";")
            case word:
                raise self._bad(word)
        if self._peek() == ";":
            self._take()

    def _annotations(self) -> object:
        """Skip annotations; return the value of ``@default``, if present."""
        default: object = None
        while self._peek() == "@":
            self._take()
            name = self._take()
            if self._peek() == "(":
                self._take()
                words = self._skip(")")
                self._take(")")
                if name == "default" and words[:2] == ["value", "="] and len(words) == 3:
                    default = _literal(words[2])
        return default

    def _struct(self, modules: tuple[str, ...]) -> None:
        name = self._take()
        fields: dict[str, MessageField] = {}
        if self._peek() == ":":
            raise BadDefinition(
                f"{self._owner}: {name} inherits from a structure, which is not supported"
            )
        self._take("{")
        while self._peek() != "}":
            default = self._annotations()
            kind = self._type()
            for field, length in self._names():
                if length is not None and kind.length is not None:
                    raise BadDefinition(
                        f"{self._owner}: {field} is an array of arrays, which is not supported"
                    )
                size = kind.length if length is None else length
                fields[field] = MessageField(field, kind.name, size, default, kind.bound)
        self._take("}")
        package = modules[0] if modules else self._owner.partition("/")[0]
        full = f"{package}/{name}"
        self._found.append(Definition(full, tuple(fields.values()), {}))

    def _names(self) -> list[tuple[str, int | None]]:
        """Return the names and array lengths of a declaration, up to its semicolon."""
        found = []
        while True:
            name, length = self._take(), None
            if self._peek() == "[":
                self._take()
                length = self._size()
                self._take("]")
            if self._peek() == "[":
                raise BadDefinition(
                    f"{self._owner}: {name} is an array of arrays, which is not supported"
                )
            found.append((name, length))
            if self._take() == ";":
                return found

    def _size(self) -> int:
        word = self._take()
        if not word.isdecimal() or not 0 < int(word[:10]) <= MAX_FIXED:
            raise self._bad(word)
        return int(word)

    def _type(self) -> _Type:
        word = self._take()
        if word == "sequence":
            self._take("<")
            inner = self._type()
            bound = None
            if self._take() == ",":
                bound = self._size()
                self._take(">")
            if inner.length is not None:
                raise BadDefinition(f"{self._owner}: a sequence of arrays is not supported")
            return _Type(inner.name, 0, bound)
        if word in ("string", "wstring"):
            if self._peek() == "<":
                self._take()
                self._size()
                self._take(">")
            return _Type(word)
        while word in ("unsigned", "long", "unsigned long") and self._peek() in ("long", "short"):
            word += " " + self._take()
        if word in _PRIMITIVES:
            return _Type(_PRIMITIVES[word])
        known = self._typedefs.get(word.rpartition("::")[2])
        return known or _Type(plain_name(word))


def _literal(word: str) -> object:
    if word[:1] in "\"'":
        return word[1:-1]
    if word in ("TRUE", "FALSE"):
        return word == "TRUE"
    try:
        return int(word, 0)
    except ValueError:
        pass
    try:
        return float(word)
    except ValueError:
        return None

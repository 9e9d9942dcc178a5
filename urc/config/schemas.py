"""The schemas that ship with URC, and a fast check for documents.

The library `jsonschema` is too slow for the two speed goals of `urc validate` (decision 4).

This module compiles the keywords of the schemas to closures. If the fast check accepts a document,
the document is valid. In all other cases, including unknown keywords, URC uses `jsonschema`. A
contract test compares the fast check with `jsonschema`. Each part of a schema is compiled on first
use, so small documents need few compiled parts.
"""

import json
import re
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Final

from urc.shipped import shipped
from urc.source import Document

__all__ = ["KINDS", "QuickCheck", "fits", "kind_of", "read_schema", "shipped_check"]

KINDS: Final = ("robot", "driver", "interface", "widget")
"""Kinds of documents with a schema."""


@cache  # the shipped schemas never change at runtime
def read_schema(name: str) -> Mapping[str, Any]:
    """Return the shipped schema with this file name."""
    schema: Mapping[str, Any] = json.loads((shipped("schemas") / name).read_text("utf-8"))
    return schema


def kind_of(document: Document) -> str:
    """Return the kind of a document, or "" for a missing or unknown kind."""
    data = document.data
    kind = data.get("kind") if isinstance(data, dict) else None
    return kind if isinstance(kind, str) and kind in KINDS else ""


@cache
def shipped_check() -> "QuickCheck":
    """Return the fast check for the shipped schemas."""
    return QuickCheck(read_schema)


def fits(reference: str, value: object) -> bool:
    """Return True if a value certainly matches the schema at ``file#/pointer``; False if in doubt.

    The passes before the shape pass call this function before they use a key. These passes ignore
    values that do not match, and the shape pass reports the error.
    """
    return shipped_check().is_valid_at(reference, value)


_Check = Callable[[Any], bool]
_ANNOTATIONS: Final = frozenset(
    (
        *("$schema", "$defs", "title", "description", "examples", "default"),
        *("file", "page", "same_origin", "less_than", "argument_of", "then", "else"),
    )
)


class _UncertainError(Exception):
    """The schema contains a keyword that the fast check does not support."""


class QuickCheck:
    """Fast checks for a set of schemas that refer to each other by file name."""

    def __init__(self, read: Callable[[str], Mapping[str, Any]]) -> None:
        """Create the checks; `read` returns the schema with a given file name."""
        self._read = read
        self._references: dict[tuple[str, str], _Check] = {}

    def is_valid(self, file: str, data: object) -> bool:
        """Return True only if `data` certainly matches the schema in `file`."""
        try:
            return self.reference(file, "#")(data)
        except _UncertainError:
            return False

    def is_valid_at(self, reference: str, data: object) -> bool:
        """Return True only if `data` certainly matches the schema at ``file#/pointer``."""
        try:
            return self.reference("", reference)(data)
        except _UncertainError:
            return False

    def is_valid_inline(self, schema: Mapping[str, Any], data: object) -> bool:
        """Return True only if `data` certainly matches `schema`, which must not refer to a file."""
        try:
            return _compile(self, schema, "")(data)
        except _UncertainError:
            return False

    def reference(self, file: str, reference: str) -> _Check:
        """Return the check for ``other.json#/pointer``; the reference is relative to `file`."""
        other, _, pointer = reference.partition("#")
        place = (other or file, pointer)
        check = self._references.get(place)
        if check is None:
            schema: Any = self._read(place[0])
            for part in filter(None, pointer.split("/")):
                schema = schema[part]
            check = self._references[place] = _compile(self, schema, place[0])
        return check


def _compile(quick: QuickCheck, schema: Any, file: str) -> _Check:
    if isinstance(schema, bool):
        return lambda _: schema
    checks: list[_Check] = []
    for keyword, value in schema.items():
        if keyword in _ANNOTATIONS:
            continue
        maker = _MAKERS.get(keyword)
        if maker is None:
            raise _UncertainError(keyword)
        checks.append(maker(quick, value, schema, file))
    if len(checks) == 1:
        return checks[0]

    def check(data: Any) -> bool:
        return all(one(data) for one in checks)

    return check


def _lazy(quick: QuickCheck, schema: Any, file: str) -> _Check:
    """Return a check for `schema` that compiles itself when it is first called."""
    compiled: list[_Check] = []

    def check(data: Any) -> bool:
        if not compiled:
            compiled.append(_compile(quick, schema, file))
        return compiled[0](data)

    return check


def _is_number(data: Any) -> bool:
    return isinstance(data, (int, float)) and not isinstance(data, bool)


_TYPES: dict[str, _Check] = {
    "string": lambda data: isinstance(data, str),
    "boolean": lambda data: isinstance(data, bool),
    "null": lambda data: data is None,
    "object": lambda data: isinstance(data, dict),
    "array": lambda data: isinstance(data, list),
    "number": _is_number,
    "integer": lambda data: _is_number(data) and (isinstance(data, int) or data.is_integer()),
}


def _type(quick: QuickCheck, value: Any, schema: Any, file: str) -> _Check:
    if isinstance(value, str):
        return _TYPES[value]
    tests = [_TYPES[name] for name in value]
    return lambda data: any(test(data) for test in tests)


def _same(left: Any, right: Any) -> bool:
    """Return whether two values are equal in JSON, where 1 equals 1.0 but not true."""
    if isinstance(left, bool) or isinstance(right, bool):
        return left is right
    if isinstance(left, (dict, list)) or isinstance(right, (dict, list)):
        raise _UncertainError
    return bool(left == right)


def _const(quick: QuickCheck, value: Any, schema: Any, file: str) -> _Check:
    return lambda data: _same(data, value)


def _enum(quick: QuickCheck, value: Any, schema: Any, file: str) -> _Check:
    return lambda data: any(_same(data, one) for one in value)


def _pattern(quick: QuickCheck, value: Any, schema: Any, file: str) -> _Check:
    search = re.compile(value).search
    return lambda data: not isinstance(data, str) or search(data) is not None


def _required(quick: QuickCheck, value: Any, schema: Any, file: str) -> _Check:
    return lambda data: not isinstance(data, dict) or all(name in data for name in value)


def _properties(quick: QuickCheck, value: Any, schema: Any, file: str) -> _Check:
    checks = {name: _lazy(quick, inner, file) for name, inner in value.items()}

    def check(data: Any) -> bool:
        if not isinstance(data, dict):
            return True
        return all(checks[name](item) for name, item in data.items() if name in checks)

    return check


def _additional(quick: QuickCheck, value: Any, schema: Any, file: str) -> _Check:
    if "patternProperties" in schema:
        raise _UncertainError
    known = schema.get("properties", {})
    inner = _lazy(quick, value, file)

    def check(data: Any) -> bool:
        if not isinstance(data, dict):
            return True
        return all(inner(item) for name, item in data.items() if name not in known)

    return check


def _names(quick: QuickCheck, value: Any, schema: Any, file: str) -> _Check:
    inner = _lazy(quick, value, file)
    return lambda data: not isinstance(data, dict) or all(inner(name) for name in data)


def _items(quick: QuickCheck, value: Any, schema: Any, file: str) -> _Check:
    if "prefixItems" in schema:
        raise _UncertainError
    inner = _lazy(quick, value, file)
    return lambda data: not isinstance(data, list) or all(inner(item) for item in data)


def _if(quick: QuickCheck, value: Any, schema: Any, file: str) -> _Check:
    test = _lazy(quick, value, file)
    then = _lazy(quick, schema.get("then", True), file)
    otherwise = _lazy(quick, schema.get("else", True), file)
    return lambda data: then(data) if test(data) else otherwise(data)


def _reference(quick: QuickCheck, value: Any, schema: Any, file: str) -> _Check:
    return lambda data: quick.reference(file, value)(data)


def _size(kind: type[Any], fits: Callable[[int, int], bool]) -> Any:
    def maker(quick: QuickCheck, value: Any, schema: Any, file: str) -> _Check:
        return lambda data: not isinstance(data, kind) or fits(len(data), value)

    return maker


def _range(fits: Callable[[float, float], bool]) -> Any:
    def maker(quick: QuickCheck, value: Any, schema: Any, file: str) -> _Check:
        return lambda data: not _is_number(data) or fits(data, value)

    return maker


_MAKERS: dict[str, Callable[[QuickCheck, Any, Any, str], _Check]] = {
    "$ref": _reference,
    "additionalProperties": _additional,
    "const": _const,
    "enum": _enum,
    "if": _if,
    "items": _items,
    "maxItems": _size(list, lambda size, limit: size <= limit),
    "maxLength": _size(str, lambda size, limit: size <= limit),
    "maxProperties": _size(dict, lambda size, limit: size <= limit),
    "maximum": _range(lambda number, limit: number <= limit),
    "minItems": _size(list, lambda size, limit: size >= limit),
    "minLength": _size(str, lambda size, limit: size >= limit),
    "minProperties": _size(dict, lambda size, limit: size >= limit),
    "minimum": _range(lambda number, limit: number >= limit),
    "exclusiveMinimum": _range(lambda number, limit: number > limit),
    "pattern": _pattern,
    "properties": _properties,
    "propertyNames": _names,
    "required": _required,
    "type": _type,
}

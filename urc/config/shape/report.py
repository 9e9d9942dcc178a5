"""Converts errors from `jsonschema` into problems with exact positions.

URC imports this module only for invalid documents, because `jsonschema` takes 80 ms to import.
"""

from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from typing import Any, Final, NamedTuple

from jsonschema import Draft202012Validator
from jsonschema.exceptions import ValidationError
from jsonschema.validators import extend
from referencing import Registry, Resource
from referencing.jsonschema import DRAFT202012

from urc.config.shape.hints import (
    example_of,
    inner_key_hint,
    key_hint,
    mapping_hint,
    number_hint,
    text_hint,
    type_hint,
    word_hint,
)
from urc.config.spelling_suggestions import listed
from urc.problems import Problem
from urc.source import Document, Path

__all__ = ["report"]


class _Error(NamedTuple):
    """One validation error from `jsonschema`."""

    keyword: str
    limit: Any
    """Value that the schema assigns to `keyword`, such as a minimum."""
    value: Any
    """Invalid value in the document."""
    schema: Mapping[str, Any]
    is_name: bool
    """Whether the error concerns the name of a key."""


_Read = Callable[[str], Mapping[str, Any]]
_Report = Callable[[Document, Path, _Error], list[Problem]]
_PROBLEMS_MOST: Final = 200
_EXPECTED: Final = {
    "string": "text",
    "number": "a number",
    "integer": "a whole number",
    "boolean": "true or false",
    "object": "a mapping",
    "array": "a list",
    "null": "null",
}


def report(
    document: Document, schema: Mapping[str, Any], read: _Read, path: Path = (), value: Any = None
) -> list[Problem]:
    """Return the problems in the part at `path`; problems with the deepest paths come first.

    `schema` describes this part. `read` returns the schema with a given file name.
    """
    registry: Registry[Any] = Registry(  # type: ignore[call-arg]  # alias of attrs, unknown to mypy
        retrieve=lambda uri: Resource.from_contents(read(uri), DRAFT202012)
    )
    validator = _Validator(schema, registry=registry)
    data = value if path else document.data
    problems: dict[Problem, int] = {}
    said: set[tuple[str, int, str]] = set()  # a branch may repeat an error of its schema
    for found in validator.iter_errors(data):
        where = (*path, *found.absolute_path)
        error = _error(found)
        tell = _REPORTS.get(error.keyword, _other)
        for problem in tell(document, where, error):
            what = problem.message if problem.code != "wrong-type" else ""
            what = what.partition(" missing from ")[0]  # a branch may have another title
            if (one := (problem.path, problem.column, what)) not in said:
                said.add(one)
                problems[problem] = len(where)
        if len(problems) >= _PROBLEMS_MOST:
            break
    return sorted(problems, key=lambda one: (-problems[one], one.line, one.column, one.path))


def _branches(
    validator: Any, condition: Any, instance: Any, schema: Mapping[str, Any]
) -> Iterator[ValidationError]:
    """Check ``then`` or ``else``; report missing keys as errors of the outer schema."""
    branch = "then" if validator.evolve(schema=condition).is_valid(instance) else "else"
    for error in validator.descend(instance, schema.get(branch, True), schema_path=branch):
        if not error.path and "properties" in schema and "properties" not in error.schema:
            error.schema = schema
        yield error


_Validator: Any = extend(Draft202012Validator, {"if": _branches})  # type: ignore[no-untyped-call]  # untyped


def _error(found: ValidationError) -> _Error:
    schema: Any = found.schema
    return _Error(
        str(found.validator),
        found.validator_value,
        found.instance,
        schema if isinstance(schema, dict) else {},
        "propertyNames" in found.absolute_schema_path,
    )


def _unknown_keys(document: Document, path: Path, error: _Error) -> list[Problem]:
    known = error.schema.get("properties", {})
    return [
        document.problem(
            (*path, key),
            "unknown-key",
            f"{_cut(key)} is not a key of {_noun(error.schema)}",
            hint=key_hint(key, known, error.value[key], path),
            key=True,
        )
        for key in islice((key for key in error.value if key not in known), _PROBLEMS_MOST)
    ]


def _missing_keys(document: Document, path: Path, error: _Error) -> list[Problem]:
    known = error.schema.get("properties", {})
    # A mapping that allows any key has no unknown keys.
    is_closed = bool(known) and error.schema.get("additionalProperties") is False
    misspelt = [
        key_hint(key, known, error.value[key], path)
        for key in error.value
        if is_closed and key not in known
    ]
    missing = [
        f"'{name}'"
        for name in error.limit
        if name not in error.value and not any(f"'{name}'" in hint for hint in misspelt)
    ]
    if not missing:
        return []  # the misspelt key is already reported
    verb = "is" if len(missing) == 1 else "are"
    names = " and ".join((", ".join(missing[:-1]), missing[-1])) if missing[1:] else missing[0]
    return [
        document.problem(
            path,
            "missing-key",
            f"{names} {verb} missing from {_noun(error.schema)}",
            hint=example_of(document, path, error.schema, missing[0].strip("'")),
            key=True,
        )
    ]


def _wrong_name(document: Document, path: Path, error: _Error) -> list[Problem]:
    """Return a problem for an invalid key name; `path` is the path of the mapping."""
    if not isinstance(error.value, str):
        return [_other_one(document, path, error)]
    message = f"{_cut(error.value)} is not a valid name"
    if error.keyword == "maxLength":
        message += f": the name has more than {error.limit} characters"
    return [
        document.problem(
            (*path, error.value),
            "bad-name",
            message,
            hint=str(error.schema.get("description", "")).rstrip("."),
            key=True,
        )
    ]


def _wrong_type(document: Document, path: Path, error: _Error) -> list[Problem]:
    types = error.limit
    types = [types] if isinstance(types, str) else types
    title = error.schema.get("title")
    if title == "duration":
        wanted = "a duration such as 250ms, 1s or 2m"
    else:
        wanted = " or ".join(_EXPECTED[name] for name in types)
    message = f"expected {wanted}, found {_found(error.value)}"
    hint = type_hint(document, path, error.value, types, is_duration=title == "duration")
    known = error.schema.get("properties", {}) if "object" in types else {}
    if inner := inner_key_hint(document, path, known):
        return [document.problem(path, "wrong-type", message, hint=inner, key=True)]
    is_text = isinstance(error.value, (str, bool))
    if {"number", "integer"} & {*types} and isinstance(error.value, str):
        is_text = not number_hint(document, path, error.value)
    if is_text and "object" in types:
        hint = mapping_hint(document, path, error.value, error.schema) or hint
    return [document.problem(path, "wrong-type", message, hint=hint)]


def _wrong_word(document: Document, path: Path, error: _Error) -> list[Problem]:
    words = [str(word) for word in error.limit]
    message = f"expected one of {listed(words, None)}; found {_found(error.value)}"
    hint = word_hint(str(error.value), words)
    return [document.problem(path, "unknown-word", message, hint=hint)]


def _wrong_constant(document: Document, path: Path, error: _Error) -> list[Problem]:
    if path == ("urc",):
        return [
            document.problem(
                path,
                "wrong-version",
                f"expected version 1 of the language, found {_found(error.value)}",
                hint="write 'urc: 1'",
            )
        ]
    message = f"expected {error.limit!r}, found {_found(error.value)}"
    return [document.problem(path, "unknown-word", message)]


def _wrong_pattern(document: Document, path: Path, error: _Error) -> list[Problem]:
    noun = _noun(error.schema)
    hint = str(error.schema.get("description", "")).rstrip(".")
    examples = error.schema.get("examples", ())
    if examples:
        hint = f"such as {listed(str(one) for one in examples)}; {hint[:1].lower()}{hint[1:]}"
    hint = text_hint(document, path, error.value, error.schema) or hint
    return [document.problem(path, "bad-text", f"{_cut(error.value)} is not {noun}", hint=hint)]


def _out_of_range(document: Document, path: Path, error: _Error) -> list[Problem]:
    words = {"minimum": "at least", "maximum": "at most"}
    message = f"expected {words[error.keyword]} {error.limit}, found {error.value}"
    return [document.problem(path, "out-of-range", message)]


def _wrong_size(document: Document, path: Path, error: _Error) -> list[Problem]:
    keyword = error.keyword
    unit = {"Length": "characters", "Items": "items", "Properties": "keys"}[keyword[3:]]
    limit = error.limit
    if keyword.startswith("min") and limit == 1:
        empty = {"characters": "text", "items": "a list", "keys": "a mapping"}[unit]
        message = f"expected {empty} that is not empty"
    else:
        word = "at least" if keyword.startswith("min") else "at most"
        message = f"expected {word} {limit} {unit}, found {len(error.value)}"
    return [document.problem(path, "wrong-size", message)]


def _other(document: Document, path: Path, error: _Error) -> list[Problem]:
    return [_other_one(document, path, error)]


def _other_one(document: Document, path: Path, error: _Error) -> Problem:
    return document.problem(
        path,
        "bad-value",
        f"{_found(error.value)} breaks the rule '{error.keyword}' of {_noun(error.schema)}",
    )


def _in_names(tell: _Report) -> _Report:
    """Return a function that reports invalid key names itself and passes other errors to `tell`."""

    def choose(document: Document, path: Path, error: _Error) -> list[Problem]:
        return (_wrong_name if error.is_name else tell)(document, path, error)

    return choose


_REPORTS: dict[str, _Report] = {
    "additionalProperties": _unknown_keys,
    "const": _wrong_constant,
    "enum": _wrong_word,
    "maxItems": _wrong_size,
    "maxLength": _in_names(_wrong_size),
    "maxProperties": _wrong_size,
    "maximum": _out_of_range,
    "minItems": _wrong_size,
    "minLength": _wrong_size,
    "minProperties": _wrong_size,
    "minimum": _out_of_range,
    "pattern": _in_names(_wrong_pattern),
    "required": _missing_keys,
    "type": _wrong_type,
}


def _noun(schema: Mapping[str, Any]) -> str:
    noun = _plain_noun(schema)
    if noun.startswith("the "):
        return noun
    if noun.endswith("s") and not noun.endswith("ss"):
        return noun
    return f"{'an' if noun[:1] in 'aeiou' else 'a'} {noun}"


def _plain_noun(schema: Mapping[str, Any]) -> str:
    title = str(schema.get("title", "document" if "properties" in schema else "valid value"))
    return title[:1].lower() + title[1:]


def _found(value: object) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return f"the number {value}"
    if isinstance(value, str):
        return f"the text {_cut(value)}"
    return "a mapping" if isinstance(value, dict) else "a list"


def _cut(text: str, most: int = 60) -> str:
    return repr(text if len(text) <= most else text[: most - 1] + "…")

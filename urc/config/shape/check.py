"""The shape pass checks a document against the schema of its kind.

The fast check in `urc.config.schemas` accepts valid documents. The library `jsonschema` checks all
other documents, and `urc.config.shape.report` converts its errors to problems.
"""

import math
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, Final

from urc.config.schemas import KINDS, QuickCheck, kind_of, read_schema, shipped_check
from urc.config.spelling_suggestions import did_you_mean
from urc.problems import Problem
from urc.source import Document, Path

__all__ = ["check_file", "check_inline", "check_options", "check_shape", "check_source"]


def check_shape(document: Document) -> list[Problem]:
    """Return a problem for every difference between a document and the schema of its kind."""
    kind = kind_of(document)
    if not kind:
        return [_without_kind(document)]
    return check_file(document, f"{kind}.schema.json")


def check_file(document: Document, file: str) -> list[Problem]:
    """Return a problem for every difference between a document and the schema in `file`."""
    problems = [
        document.problem(
            path,
            "not-finite",
            f"expected a number, found {number}",
            hint="numbers must be finite",
        )
        for path, number in _not_finite(document.data, ())
    ]
    if not shipped_check().is_valid(file, document.data):
        from urc.config.shape.report import report

        problems += report(document, read_schema(file), read_schema)
    return problems


def check_source(document: Document) -> list[Problem]:
    """Check one source of a merged document for problems that the merge would hide.

    The merge may remove unknown keys, and removes keys such as ``extends``. Missing keys are not
    reported, because another source may add them. The shape pass also checks the merged document.
    """
    if not kind_of(document):
        return [_without_kind(document)]
    data = _without_nothing(document.data)
    if isinstance(document.data, dict) and isinstance(data, dict):
        data |= {key: None for key in _OWN_KEYS if document.data.get(key, "") is None}
    file = f"{kind_of(document)}.schema.json"
    if _quick_source().is_valid(file, data):
        return []
    from urc.config.shape.report import report

    pruned = Document(document.file, document.text, document.lines, data, document.mark)
    return [
        problem
        for problem in report(pruned, _source_schema(file), _source_schema)
        if problem.code == "unknown-key" or problem.path.partition(".")[0] in _OWN_KEYS
    ]


_OWN_KEYS: Final = ("urc", "extends", "include", "partial")
"""Keys that a merge never takes over from an extended or included document."""


@cache
def _quick_source() -> QuickCheck:
    return QuickCheck(_source_schema)


@cache
def _source_schema(name: str) -> Mapping[str, Any]:
    schema: Mapping[str, Any] = _optional(read_schema(name))
    return schema


def _optional(schema: Any) -> Any:
    """Return a schema without lists of required keys, except in ``if`` conditions."""
    if isinstance(schema, list):
        return [_optional(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    return {
        key: item if key == "if" else _optional(item)
        for key, item in schema.items()
        if key not in ("required", "minProperties") or isinstance(item, dict)
    }


def _without_nothing(value: object) -> object:
    """Return data without null values, because a null removes a key in a merge."""
    if isinstance(value, dict):
        return {key: _without_nothing(item) for key, item in value.items() if item is not None}
    if isinstance(value, list):
        return [_without_nothing(item) for item in value]
    return value


def check_options(
    document: Document, path: Path, value: object, options: Mapping[str, object]
) -> list[Problem]:
    """Return a problem for every difference between a slot's options and the widget's manifest.

    `options` contains the JSON Schema of each option.
    """
    schema = {
        "title": "the options of this widget",
        "type": "object",
        "properties": options,
        "additionalProperties": False,
    }
    return check_inline(document, path, value, schema)


def check_inline(
    document: Document, path: Path, value: object, schema: Mapping[str, Any]
) -> list[Problem]:
    """Return the problems in a part of a document; `schema` must not refer to a file."""
    if shipped_check().is_valid_inline(schema, value):
        return []
    from urc.config.shape.report import report

    return report(document, schema, read_schema, path, value)


def _without_kind(document: Document) -> Problem:
    data = document.data
    if not isinstance(data, dict):
        return document.problem(
            (),
            "wrong-type",
            "a document must be a mapping of keys to values",
            hint="a document starts with 'urc: 1' and 'kind: robot'",
        )
    if "kind" not in data:
        near = {"knd", "type", "kinds"} & data.keys()
        instead = f"instead of '{near.pop()}', " if near else ""
        return document.problem(
            (),
            "missing-key",
            "'kind' is missing",
            hint=f"{instead}write one of: " + ", ".join(f"'kind: {kind}'" for kind in KINDS),
        )
    kind = data["kind"]
    return document.problem(
        ("kind",),
        "unknown-kind",
        f"there is no document kind {kind!r}",
        hint="write 'kind: robot'"
        if kind in ("profile", "robot-profile", "robots")
        else did_you_mean(str(kind), KINDS, "kinds"),
    )


def _not_finite(value: object, path: Path) -> Iterator[tuple[Path, float]]:
    if isinstance(value, float):
        if not math.isfinite(value):
            yield path, value
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from _not_finite(item, (*path, key))
    elif isinstance(value, list):
        for place, item in enumerate(value):
            yield from _not_finite(item, (*path, place))

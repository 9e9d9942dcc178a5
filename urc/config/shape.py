"""The shape pass: does a document fit the schema of its kind?

A quick verdict comes first; `jsonschema` is imported only for documents that it does not clear, and
`urc.config.shape_report` tells its errors in words of our own.
"""

import json
import math
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, Final

from urc.config.quick import QuickCheck
from urc.config.suggest import did_you_mean
from urc.problems import Problem
from urc.shipped import shipped
from urc.source import Document, Path

__all__ = ["KINDS", "check_options", "check_shape", "kind_of", "read_schema"]

KINDS: Final = ("robot", "driver", "interface", "widget")


@cache  # the schemas ship with URC and do not change while it runs
def read_schema(name: str) -> Mapping[str, Any]:
    """Return a shipped schema by its file name."""
    schema: Mapping[str, Any] = json.loads((shipped("schemas") / name).read_text("utf-8"))
    return schema


@cache
def _quick() -> QuickCheck:
    return QuickCheck(read_schema)


def kind_of(document: Document) -> str:
    """Return the document's kind, or "" when it names none that there is."""
    data = document.data
    kind = data.get("kind") if isinstance(data, dict) else None
    return kind if isinstance(kind, str) and kind in KINDS else ""


def check_shape(document: Document) -> list[Problem]:
    """Return every difference between a document and the schema of its kind."""
    kind = kind_of(document)
    if not kind:
        return [_without_kind(document)]
    problems = [
        document.problem(
            path,
            "not-finite",
            f"expected a number, found {number}",
            hint="no number of the language is infinite or undefined",
        )
        for path, number in _not_finite(document.data, ())
    ]
    file = f"{kind}.schema.json"
    if not _quick().is_valid(file, document.data):
        from urc.config.shape_report import report

        problems += report(document, read_schema(file), read_schema)
    return problems


def check_options(
    document: Document, path: Path, value: object, options: Mapping[str, object]
) -> list[Problem]:
    """Return every difference between a slot's options and what the widget's manifest declares.

    Args:
        document: where the options stand.
        path: where in it.
        value: the options as written.
        options: JSON Schema of each option.
    """
    schema = {
        "title": "the options of this widget",
        "type": "object",
        "properties": options,
        "additionalProperties": False,
    }
    if _quick().is_valid_inline(schema, value):
        return []
    from urc.config.shape_report import report

    return report(document, schema, read_schema, path, value)


def _without_kind(document: Document) -> Problem:
    data = document.data
    if not isinstance(data, dict):
        return document.problem(
            (),
            "wrong-type",
            "a document is a mapping of keys to values",
            hint="it starts with 'urc: 1' and 'kind: robot'",
        )
    if "kind" not in data:
        near = {"knd", "type", "kinds"} & data.keys()
        instead = f"instead of '{near.pop()}', " if near else ""
        return document.problem(
            (),
            "missing-key",
            "'kind' is missing: what is this document?",
            hint=f"{instead}write one of: " + ", ".join(f"'kind: {kind}'" for kind in KINDS),
        )
    kind = data["kind"]
    return document.problem(
        ("kind",),
        "unknown-kind",
        f"there is no kind of document {kind!r}",
        hint=did_you_mean(str(kind), KINDS, "kinds"),
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

"""Problem reports in SARIF 2.1.0 and as annotations of GitHub workflow runs.

`urc.problems` contains the text and JSON formats.
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePath
from typing import Final
from urllib.parse import quote

from urc.problems import Problem, printable

__all__ = ["to_github", "to_sarif"]

_SCHEMA: Final = (
    "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
)
_DATA: Final = {"%": "%25", "\r": "%0D", "\n": "%0A"}
"""Escape sequences in the message of a workflow command."""
_PROPERTY: Final = str.maketrans(_DATA | {":": "%3A", ",": "%2C"})
"""Escape sequences in a workflow command's properties, including their separators."""
_MESSAGE: Final = str.maketrans(_DATA)


def to_github(problem: Problem) -> str:
    """Return the problem as a workflow command on one line."""
    properties = {
        "file": _slashed(problem.file),
        "line": str(problem.line),
        "endLine": str(problem.line),
        "col": str(problem.column),
        "endColumn": str(problem.end_column or problem.column + 1),
        "title": f"urc {problem.code}",
    }
    words = ",".join(f"{name}={text.translate(_PROPERTY)}" for name, text in properties.items())
    where = f"{problem.path}: " if problem.path else ""
    lines = [printable(where + problem.message), *filter(None, [printable(problem.hint)])]
    return f"::{problem.severity} {words}::" + "\n".join(lines).translate(_MESSAGE)


def to_sarif(
    problems: Sequence[Problem], version: str, summaries: Mapping[str, str]
) -> dict[str, object]:
    """Return the problems as a SARIF log with one run.

    Args:
        problems: all problems.
        version: URC's version, for the log's `tool`.
        summaries: one-sentence summaries, by problem code.
    """
    codes = list(dict.fromkeys(problem.code for problem in problems))
    return {
        "$schema": _SCHEMA,
        "version": "2.1.0",
        "runs": [
            {
                "tool": {
                    "driver": {
                        "name": "urc",
                        "version": version,
                        "rules": [_rule(code, summaries.get(code, "")) for code in codes],
                    }
                },
                "columnKind": "unicodeCodePoints",
                "results": [_result(problem, codes.index(problem.code)) for problem in problems],
            }
        ],
    }


def _rule(code: str, summary: str) -> dict[str, object]:
    rule: dict[str, object] = {"id": code}
    if summary:
        rule["shortDescription"] = {"text": summary}
    rule["help"] = {"text": f"Run 'urc explain {code}' for an explanation."}
    return rule


def _result(problem: Problem, rule: int) -> dict[str, object]:
    region: dict[str, object] = {"startLine": problem.line, "startColumn": problem.column}
    if problem.end_column > problem.column:
        region["endColumn"] = problem.end_column
    place: dict[str, object] = {"artifactLocation": {"uri": _uri(problem.file)}, "region": region}
    if problem.source:
        whole = {"startLine": problem.line, "snippet": {"text": problem.source}}
        place["contextRegion"] = whole
    location: dict[str, object] = {"physicalLocation": place}
    if problem.path:
        location["logicalLocations"] = [{"fullyQualifiedName": problem.path}]
    return {
        "ruleId": problem.code,
        "ruleIndex": rule,
        "level": problem.severity,
        "message": {"text": _sentences((problem.message, problem.hint))},
        "locations": [location],
    }


def _sentences(texts: Iterable[str]) -> str:
    return "\n".join(printable(text) for text in texts if text)


def _slashed(file: str) -> str:
    return file.replace(os.sep, "/")


def _uri(file: str) -> str:
    """Return a file's URI reference, either absolute or relative to the run's folder."""
    path = PurePath(file)
    return path.as_uri() if path.is_absolute() else quote(_slashed(file))

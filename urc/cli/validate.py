"""`urc validate`: every finding in documents, and their own tests. Needs no robot, no network.

Imports as little as it can: people run it on every save.
"""

import argparse
from contextlib import suppress

from urc.cli.output import complain, json_text
from urc.problems import Problem, has_errors, to_json, to_text

EXAMPLE = "urc validate robots/*.yaml"


class _Report:
    """What was found in all documents of one run."""

    def __init__(self) -> None:
        self.files = 0
        self.tests = 0
        self.failed = 0
        """Tests that failed."""
        self.problems: list[Problem] = []
        """In the order of the command line; each once, though several documents may share it."""

    def add(self, problems: list[Problem]) -> None:
        self.problems = list(dict.fromkeys([*self.problems, *problems]))

    def count(self, severity: str) -> int:
        return sum(problem.severity == severity for problem in self.problems)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the documents and the format."""
    parser.add_argument("paths", metavar="PATH", nargs="+", help="documents of any kind")
    parser.add_argument(
        "--format", choices=("text", "json"), default="text", help="of the report (default: text)"
    )
    parser.add_argument("--strict", action="store_true", help="warnings fail, too")
    parser.add_argument(
        "--no-tests", action="store_true", help="leave out the documents' own tests"
    )


def run(arguments: argparse.Namespace) -> int:
    """Check all documents, print the report; 1 when there is an error in any of them."""
    report = _examine(list(dict.fromkeys(arguments.paths)), with_tests=not arguments.no_tests)
    with suppress(BrokenPipeError):  # `urc validate … | head` has findings all the same
        if arguments.format == "json":
            print(json_text(_as_json(report), indent=2))
        else:
            _print_text(report)
    return int(has_errors(report.problems) or (arguments.strict and bool(report.problems)))


def _examine(paths: list[str], *, with_tests: bool) -> _Report:
    from urc.config.load import Shelf, check
    from urc.runtime.catalog import built_in_catalog
    from urc.runtime.selftest import run_tests
    from urc.shipped import shipped

    report, catalog, shelf = _Report(), built_in_catalog(), Shelf(shipped("widgets"))
    for path in paths:
        report.files += 1
        checked = check(path, catalog, shelf)
        report.add(list(checked.problems))
        if checked.profile is not None and with_tests:
            failures = run_tests(checked.profile)
            report.tests += len(checked.profile.tests)
            report.failed += len(failures)
            report.add(failures)
    return report


def _print_text(report: _Report) -> None:
    for problem in report.problems:
        print(to_text(problem))
    words = [_count(report.count(severity), severity) for severity in ("error", "warning")]
    if report.tests:
        passed = report.tests - report.failed
        words.append(f"{passed} of {_count(report.tests, 'test')} passed")
    complain(f"{_count(report.files, 'document')}: {', '.join(words)}")


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _as_json(report: _Report) -> dict[str, object]:
    return {
        "files": report.files,
        "errors": report.count("error"),
        "warnings": report.count("warning"),
        "tests": {"run": report.tests, "failed": report.failed},
        "problems": [to_json(problem) for problem in report.problems],
    }

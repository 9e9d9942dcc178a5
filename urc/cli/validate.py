"""`urc validate`: check documents and run their tests.

The command needs no robot and no network. This module imports few modules, because editors run the
command on every save.
"""

import argparse
import os
import sys
from contextlib import suppress
from typing import TYPE_CHECKING

from urc.cli.arguments import profile_path
from urc.cli.colours import coloured_problem, is_terminal
from urc.cli.output import complain, json_text
from urc.problems import Problem, UrcError, has_errors, printable, to_json

if TYPE_CHECKING:
    from urc.cli.progress import Progress
    from urc.config.load import WidgetFolder
    from urc.model.profile import Profile
    from urc.model.widget import Widget
    from urc.runtime.coverage import Coverage

EXAMPLE = "urc validate puppet"

FORMATS = ("text", "json", "sarif", "github")
_BROWSER = "emscripten"
"""Platform of the playground, which opens no transport, so no package is missing there."""


class _Report:
    """Collects the problems and test results of all documents of one run."""

    def __init__(self) -> None:
        self.files = 0
        self.tests = 0
        self.failed = 0
        """Number of failed tests."""
        self.is_cut_short = False
        """Whether errors in a document prevented later checks of the document."""
        self.problems: list[Problem] = []
        """Problems in command-line order, without duplicates from shared documents."""
        self.coverage: list[Coverage] = []
        """Test coverage of each tested profile."""
        self.notes: list[str] = []
        """Notes about this computer, which are no problems of the documents."""
        self.looked_at: dict[str, None] = {}
        """Paths of all files that affect the result, including missing files."""

    def add(self, problems: list[Problem]) -> None:
        self.problems = list(dict.fromkeys([*self.problems, *problems]))

    def count(self, severity: str) -> int:
        return sum(problem.severity == severity for problem in self.problems)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: documents, format and checks."""
    parser.add_argument(
        "paths", metavar="PATH", nargs="+", help="documents of any kind or robot names"
    )
    parser.add_argument(
        "--format", choices=FORMATS, default="text", help="format of the report (default: text)"
    )
    parser.add_argument(
        "--strict", action="store_true", help="exit with code 1 even if there are only warnings"
    )
    parser.add_argument(
        "--no-tests", action="store_true", help="do not run the tests in the documents"
    )
    parser.add_argument(
        "--coverage", action="store_true", help="list commands, polls and messages without a test"
    )
    parser.add_argument(
        "--watch",
        action="store_true",
        help="repeat the check after every change to a document, until Ctrl-C",
    )


def run(arguments: argparse.Namespace) -> int:
    """Check all documents and print the report; return 1 after an error."""
    paths = list(dict.fromkeys(map(_document_in, arguments.paths)))
    if arguments.watch:
        return _watch(paths, arguments)
    report = _examined(paths, with_tests=not arguments.no_tests)
    with suppress(BrokenPipeError):  # keeps the exit code, as in `… | head`
        _print(report, arguments, indent=2)
    return _exit_code(report, arguments)


def _exit_code(report: _Report, arguments: argparse.Namespace) -> int:
    return int(has_errors(report.problems) or (arguments.strict and bool(report.problems)))


def _watch(paths: list[str], arguments: argparse.Namespace) -> int:
    """Check the documents now and after every change; on Ctrl-C, return the last exit code."""
    from urc.runtime.file_watch import FileWatcher, wait_for_change

    code = 0
    try:
        while True:
            watched = FileWatcher(paths)  # created before reading, so that no change is missed
            report = _examined(paths, with_tests=not arguments.no_tests)
            watched.add(report.looked_at)
            code = _exit_code(report, arguments)
            _print(report, arguments)
            if arguments.format == "text":
                complain("watching; Ctrl-C ends it")
            changed = wait_for_change(watched)
            if arguments.format == "text":
                complain(f"changed: {', '.join(changed)}")
    except KeyboardInterrupt:
        return code


def _examined(paths: list[str], *, with_tests: bool) -> _Report:
    """Check the documents; for several documents on a terminal, show a status line."""
    if not paths[1:] or not is_terminal(sys.stderr):
        return _examine(paths, with_tests=with_tests)
    from urc.cli.progress import Progress

    with Progress("checking", len(paths)) as progress:
        return _examine(paths, with_tests=with_tests, progress=progress)


def _examine(paths: list[str], *, with_tests: bool, progress: "Progress | None" = None) -> _Report:
    from urc.config.load import WidgetFolder, check
    from urc.runtime.coverage import measure
    from urc.runtime.document_tests import exercise
    from urc.runtime.registries import built_in_catalog
    from urc.shipped import shipped

    report, catalog, registry = _Report(), built_in_catalog(), WidgetFolder(shipped("widgets"))
    for path in paths:
        if progress is not None:
            progress.step(path)
        report.files += 1
        checked = check(path, catalog, _widgets_of_package(path) or registry)
        report.add(list(checked.problems))
        report.is_cut_short |= checked.is_cut_short
        report.looked_at |= dict.fromkeys(checked.files)
        if checked.kind == "widget":
            _examine_folder(path, checked.widget, report)
        if checked.profile is not None:
            _examine_own_widgets(checked.profile, report)
        if checked.profile is not None and with_tests:
            outcome = exercise(checked.profile)
            report.tests += len(checked.profile.tests)
            report.failed += len(outcome.problems)
            report.add(outcome.problems)
            report.coverage.append(measure(path, checked.profile.driver, outcome.exercised))
        if checked.profile is not None and sys.platform != _BROWSER:
            _note_missing_packages(path, checked.profile, report)
    return report


def _note_missing_packages(path: str, profile: "Profile", report: _Report) -> None:
    """Note each extra that the profile needs and this computer lacks."""
    from urc.runtime.missing_packages import missing_packages
    from urc.runtime.registries import built_in_catalog

    missing = missing_packages(profile, {}, built_in_catalog().transports)
    report.notes += missing.of(path, "cannot be opened on this computer")


def _examine_folder(
    path: str, widget: "Widget | None", report: _Report, *, with_demo: bool = True
) -> None:
    """Add the problems in a widget's files to the report, if the widget's manifest is valid."""
    from urc.web.show.widget_check import FILES, check_widget

    home = os.path.dirname(path)
    report.looked_at |= dict.fromkeys(os.path.join(home, name) for name in FILES)
    if widget is not None:
        report.add(check_widget(widget, with_demo=with_demo))


def _examine_own_widgets(profile: "Profile", report: _Report) -> None:
    """Add the problems in a document's widgets to the report; skip shipped widgets."""
    from urc.shipped import shipped

    home = shipped("widgets").resolve()
    for widget in profile.widgets.values():
        if widget.folder.resolve().parent != home:
            _examine_folder(str(widget.folder / "widget.yaml"), widget, report, with_demo=False)


def _document_in(path: str) -> str:
    """Return the path of the document for a path or a robot name.

    For a widget's folder, the document is the manifest. A missing file is reported like other
    problems.
    """
    manifest = os.path.join(path, "widget.yaml")
    if os.path.isfile(manifest):
        return manifest
    with suppress(UrcError):
        return profile_path(path)
    return path


def _widgets_of_package(path: str) -> "WidgetFolder | None":
    """Return the widgets in a document's folder or package; None without widgets."""
    home = os.path.dirname(path)
    is_package = os.path.isfile(os.path.join(home, "package.yaml"))
    if not is_package and not os.path.isdir(os.path.join(home, "widgets")):
        return None
    from urc.runtime.widget_registry import widget_folder_of

    return widget_folder_of(path)


def _print(report: _Report, arguments: argparse.Namespace, indent: int | None = None) -> None:
    """Print a report. Without `indent`, a machine-readable report is a single line."""
    if arguments.format == "json":
        print(json_text(_as_json(report), indent), flush=True)
    elif arguments.format == "sarif":
        from urc import __version__
        from urc.config.codes import summaries
        from urc.config.report_formats import to_sarif

        log = to_sarif(report.problems, __version__, summaries())
        print(json_text(log, indent), flush=True)
    else:
        if arguments.format == "github":
            from urc.config.report_formats import to_github as tell
        else:
            tell = coloured_problem
        for problem in report.problems:
            print(tell(problem), flush=True)
        if arguments.coverage:
            _print_coverage(report)
        for note in report.notes:
            complain(printable(note))
        complain(_summary(report))


def _print_coverage(report: _Report) -> None:
    for coverage in report.coverage:
        tested = coverage.total - len(coverage.untested)
        print(f"{coverage.file}: {tested} of {coverage.total} commands, polls and messages tested")
        for kind, name in coverage.untested:
            print(f"  no test of {kind} {name}")


def _summary(report: _Report) -> str:
    from urc.runtime.coverage import summary

    words = [_count(report.count(severity), severity) for severity in ("error", "warning")]
    if report.tests:
        passed = report.tests - report.failed
        words.append(f"{passed} of {_count(report.tests, 'test')} passed")
    words += filter(None, [summary(report.coverage)])
    more = "; later checks run after the errors are corrected" if report.is_cut_short else ""
    return f"{_count(report.files, 'document')}: {', '.join(words)}{more}"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _as_json(report: _Report) -> dict[str, object]:
    return {
        "files": report.files,
        "errors": report.count("error"),
        "warnings": report.count("warning"),
        "more_may_follow": report.is_cut_short,
        "tests": {"run": report.tests, "failed": report.failed},
        "coverage": [
            {
                "file": coverage.file,
                "total": coverage.total,
                "untested": [{"kind": kind, "name": name} for kind, name in coverage.untested],
            }
            for coverage in report.coverage
        ],
        "problems": [to_json(problem) for problem in report.problems],
    }

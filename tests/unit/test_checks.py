"""`./dev test`, `./dev bench` and `./dev docs`: what counts as a failure, and how it is told."""

import ast
from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import pytest

from bench import __main__ as bench
from hatch_build import VendorError
from scripts import check, docs, needs
from scripts.chromium.bring import BringError
from scripts.needs import NEEDS, Brought, Need

OK = check.Outcome("lint", "", 0.1)
BAD = check.Outcome("tests", "exit code 1", 2.0)
COMPLETE = Brought()
QUICK = [[step.name] for step in (*check.QUICK, *check.STATIC)]
WITHOUT_NETCAT = Brought(left_out=[need for need in NEEDS if need.name == "netcat"])


@pytest.mark.parametrize(
    ("outcomes", "brought", "not_checked", "ci", "code", "last"),
    [
        ([OK], COMPLETE, "", "", 0, "all passed"),
        ([OK], COMPLETE, "", "true", 0, "all passed"),
        ([OK, BAD], COMPLETE, "", "", 1, "1 of 2 steps failed: tests"),
        ([OK], WITHOUT_NETCAT, "", "", 0, "all executed steps passed"),
        ([OK], COMPLETE, "the type check: no Node", "", 0, "all executed steps passed"),
        (
            [OK],
            WITHOUT_NETCAT,
            "",
            "true",
            1,
            "all executed steps passed, but with CI=true no test may be skipped",
        ),
        (
            [OK],
            COMPLETE,
            "the type check: no Node",
            "true",
            1,
            "all executed steps passed, but with CI=true no test may be skipped",
        ),
    ],
)
def test_the_verdict(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    outcomes: list[check.Outcome],
    brought: Brought,
    not_checked: str,
    ci: str,
    code: int,
    last: str,
) -> None:
    """A failed step fails; what was left out fails only with CI=true, and is always told."""
    monkeypatch.setenv("CI", ci)
    assert check.summarise(outcomes, brought, not_checked, 1.0) == code
    shown = capsys.readouterr().out
    assert shown.splitlines()[-1] == last
    assert ("LEFT OUT" in shown) == bool(brought.left_out or not_checked)


def test_the_summary_ends_with_the_names_of_the_failed_tests(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A record that keeps only the last lines still says which test failed, and why."""
    line = "FAILED tests/unit/test_lease.py::test_a_lease_ends - assert 1 == 2"
    assert check.summarise([replace(BAD, failed_tests=(line,)), OK], COMPLETE, "", 1.0) == 1
    shown = capsys.readouterr().out.splitlines()
    assert shown[-2:] == [line, "1 of 2 steps failed: tests"]


@pytest.mark.parametrize(
    ("arguments", "code", "groups", "needs_browser"),
    [
        ([], 0, [QUICK, [["site", "tests e2e"], ["tests motion"]]], True),
        (["quick"], 0, [QUICK], False),
        (["fast"], 2, [], False),
    ],
)
def test_the_quick_check_has_no_servers(
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    code: int,
    groups: list[list[list[str]]],
    needs_browser: bool,
) -> None:
    """Both run the same quick steps; a program for the other tests is not installed for them."""
    ran: list[list[list[str]]] = []
    wanted: list[str] = []

    def bring(names: tuple[Need, ...]) -> Brought:
        wanted.extend(need.name for need in names)
        return Brought()

    def run(
        sequences: Sequence[Sequence[check.Step]], environment: object, at_once: int = 2
    ) -> list[check.Outcome]:
        ran.append([[step.name for step in steps] for steps in sequences])
        return [check.Outcome(step.name, "", 0.1) for steps in sequences for step in steps]

    monkeypatch.setattr(check, "bring", bring)
    monkeypatch.setattr(check, "javascript_step", lambda: (None, ""))
    monkeypatch.setattr(check, "run", run)
    monkeypatch.setattr("sys.argv", ["check", *arguments])
    assert check.main() == code
    assert ran == groups
    assert ("chromium" in wanted) == needs_browser


def test_the_summary_names_the_command_that_brings_what_is_missing(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """One line to paste."""
    check.summarise([OK], WITHOUT_NETCAT, "", 1.0)
    lines = capsys.readouterr().out.splitlines()
    assert "LEFT OUT  tests with netcat as the client: no netcat" in lines
    assert lines[-2].endswith("apt-get install -y netcat-openbsd")


def test_what_npm_brings_is_named_and_left_out_until_it_is_there(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Without npm the tests in an editor are left out by name; with it they are not."""
    monkeypatch.setattr(needs, "LANGUAGE_SERVER", tmp_path / "server")
    server = next(need for need in NEEDS if need.name == "language-server")
    brought = Brought(left_out=[server])
    brought.look_again()
    assert brought.environment["URC_LEFT_OUT"] == "language-server"
    check.summarise([OK], brought, "", 1.0)
    lines = capsys.readouterr().out.splitlines()
    assert (
        "LEFT OUT  tests of the schemas in an editor's language server: no language-server" in lines
    )
    assert lines[-2].endswith("npm ci --ignore-scripts")
    (tmp_path / "server").touch()
    brought.look_again()
    assert brought.left_out == []
    assert brought.environment["URC_LEFT_OUT"] == ""


def test_a_benchmark_without_its_program_is_left_out_by_name(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line with the remedy, and no success; nothing is started that could only break."""
    browser = [need for need in NEEDS if need.name == "chromium"]
    monkeypatch.setattr(bench, "bring", lambda wanted: Brought(left_out=list(wanted)))
    monkeypatch.setattr("sys.argv", ["bench", "browser_peers"])
    assert bench.main() == 1
    said = capsys.readouterr()
    assert said.out == ""
    remedy = Brought(left_out=browser).remedy
    line = f"bench: browser_peers skipped: missing chromium; to install: {remedy}"
    assert said.err.splitlines() == [line]


def test_a_benchmark_brings_the_packages_of_npm(monkeypatch: pytest.MonkeyPatch) -> None:
    """A benchmark with roslib's page works in a new clone, like the tests."""
    roslib = next(need for need in NEEDS if need.name == "roslib")
    there: list[str] = []
    found = replace(roslib, other=lambda: there[0] if there else None)
    monkeypatch.setattr(bench, "bring", lambda _: Brought(left_out=[found]))
    monkeypatch.setattr(bench, "install_checkers", lambda: there.append("node_modules/roslib"))
    assert bench.bring_programs(["browser_roslibjs"]) == set()


def test_a_benchmark_without_npm_is_left_out(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The line names the command that would have installed the package."""
    roslib = next(need for need in NEEDS if need.name == "roslib")
    missing = replace(roslib, other=lambda: None)

    def fail() -> None:
        raise VendorError("npm not found")

    monkeypatch.setattr(bench, "bring", lambda _: Brought(left_out=[missing]))
    monkeypatch.setattr(bench, "install_checkers", fail)
    assert bench.bring_programs(["browser_roslibjs"]) == {"browser_roslibjs"}
    assert "missing roslib; to install: npm ci --ignore-scripts" in capsys.readouterr().err


def browsers(*, is_whole_there: bool) -> list[Need]:
    """Return the two browsers: no shell, and the whole one or not."""
    whole, shell = (need for need in NEEDS if need.name in ("chromium", "headless-shell"))
    here = ("python3",) if is_whole_there else ()
    return [replace(whole, executables=here, variable=""), replace(shell, executables=())]


def test_the_whole_browser_does_where_there_is_none_without_windows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nothing is left out for it; the tests only take longer."""
    monkeypatch.setattr(needs, "_is_root", lambda: False)
    monkeypatch.delenv("URC_HEADLESS_SHELL", raising=False)
    both = browsers(is_whole_there=True)
    brought = needs.bring(both)
    assert brought.left_out == []
    assert brought.environment["URC_HEADLESS_SHELL"] == both[0].find()


def test_the_browser_of_npm_has_no_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    """What needs the whole one is left out by name; without npm all that needs any is."""
    monkeypatch.setattr(needs, "_is_root", lambda: False)
    monkeypatch.delenv("URC_HEADLESS_SHELL", raising=False)
    monkeypatch.setattr(needs, "bring_chromium", lambda: "/of/npm")
    both = browsers(is_whole_there=False)
    brought = needs.bring(both)
    assert brought.environment["URC_HEADLESS_SHELL"] == "/of/npm"
    assert brought.left_out == both[:1]

    def fail() -> str:
        raise BringError("no Node")

    monkeypatch.setattr(needs, "bring_chromium", fail)
    assert needs.bring(both).left_out == both


def test_a_benchmark_asks_for_no_program_that_it_does_not_need(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nobody installs a browser to measure a relay."""
    asked: list[str] = []

    def bring(wanted: list[needs.Need]) -> Brought:
        asked.extend(need.name for need in wanted)
        return Brought()

    monkeypatch.setattr(bench, "bring", bring)
    assert bench.bring_programs(["fanout", "browser_widgets"]) == set()
    assert asked == ["chromium"]


def imports_of(name: str) -> set[str]:
    """Return the modules that a module of the benchmarks imports, directly or through another."""
    found: set[str] = set()
    waiting = [name]
    while waiting:
        spec = find_spec(waiting.pop())
        assert spec is not None
        assert spec.origin is not None
        tree = ast.parse(Path(spec.origin).read_text(encoding="utf-8"))
        nodes = (node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom))
        new = {node.module for node in nodes if node.module} - found
        found |= new
        waiting += [module for module in new if module.startswith("bench.")]
    return found


@pytest.mark.parametrize("name", bench.NAMES)
def test_a_benchmark_with_a_page_brings_its_browser(name: str) -> None:
    """Whatever opens one says so in the table."""
    imported = imports_of(f"bench.{name}")
    programs = bench.PROGRAMS.get(name, ())
    assert ("chromium" in programs) == ("tests.e2e.browser" in imported)
    assert ("firefox" in programs) == ("tests.e2e.browsers.firefox" in imported)
    assert ("webkit-driver" in programs) == ("tests.e2e.browsers.webkit" in imported)


@pytest.mark.parametrize(
    ("page", "faults"),
    [
        ("[a](b.md) and [c](https://example.org/x)", []),
        ("[a](missing.md)", ["README.md:1: missing.md: no such file"]),
        ("x\n\n[a](b.md#two-words)", []),
        ("x\n\n[a](b.md#three)", ["README.md:3: b.md#three: no such heading"]),
        ("```\n[a](missing.md)\n```\n![p](p.png)", ["README.md:4: p.png: no such file"]),
        ("[a](../outside.md)", ["README.md:1: ../outside.md: points outside the tree"]),
        ("# Here\n[a](#here)", []),
    ],
)
def test_links_lead_somewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, page: str, faults: list[str]
) -> None:
    """Links to files and headings of the tree are followed; code blocks are not."""
    monkeypatch.setattr(docs, "ROOT", tmp_path)
    (tmp_path / "b.md").write_text("# One\n\n## Two words\n", encoding="utf-8")
    readme = tmp_path / "README.md"
    readme.write_text(page, encoding="utf-8")
    assert list(docs.faults_of(readme)) == faults

"""`urc validate`: its two reports, its exit codes, and what it does not import."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from urc.cli.main import main

Output = pytest.CaptureFixture[str]
ROOT = Path(__file__).resolve().parents[3]

ROBOT = """\
urc: 1
kind: robot
name: bot
settings:
  port: {{ type: port, default: 1 }}
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: "{{{{ settings.port }}}}"
    framing: {{ type: delimiter, tx: LF, rx: LF }}
signals:
  battery: {{ type: integer }}
polls:
  - {{ every: 1s, send: "?", reply: {{ regex: '^(?P<battery>\\d+)$' }} }}
tests:
  - {{ name: forty-two, feed: {{ wire: "42\\n" }}, reply_to: 0, expect: {{ battery: {expected} }} }}
"""
GOOD = ROBOT.format(expected=42)
FAILING = ROBOT.format(expected=43)
WARNED = GOOD.replace("settings:\n", "settings:\n  idle: { type: port }\n")
BROKEN = GOOD.replace("every: 1s", "every: 1")


@pytest.fixture(autouse=True)
def _documents(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    documents = {"good": GOOD, "failing": FAILING, "warned": WARNED, "broken": BROKEN}
    for name, text in documents.items():
        text = text.replace("name: bot\n", f"name: {name}\n")
        Path(f"{name}.yaml").write_text(text, encoding="utf-8")
    Path("folder").mkdir()


@pytest.mark.parametrize(
    ("words", "code", "headlines", "summary"),
    [
        ("good.yaml", 0, [], "1 document: 0 errors, 0 warnings, 1 of 1 test passed"),
        ("good.yaml --strict", 0, [], "1 document: 0 errors, 0 warnings, 1 of 1 test passed"),
        (
            "good.yaml good.yaml",
            0,
            [],
            "1 document: 0 errors, 0 warnings, 1 of 1 test passed",
        ),
        (
            "failing.yaml good.yaml",
            1,
            ["failing.yaml:17:5: error test-failed tests: "],
            "2 documents: 1 error, 0 warnings, 1 of 2 tests passed",
        ),
        ("failing.yaml --no-tests", 0, [], "1 document: 0 errors, 0 warnings"),
        (
            "warned.yaml",
            0,
            ["warned.yaml:5:3: warning unused-setting settings.idle: "],
            "1 document: 0 errors, 1 warning, 1 of 1 test passed",
        ),
        (
            "--strict warned.yaml",
            1,
            ["warned.yaml:5:3: warning unused-setting settings.idle: "],
            "1 document: 0 errors, 1 warning, 1 of 1 test passed",
        ),
        (
            "gone.yaml folder broken.yaml",
            1,
            [
                "gone.yaml:1:1: error no-such-file: ",
                "folder:1:1: error is-directory: ",
                "broken.yaml:15:14: error wrong-type polls.0.every: ",
            ],
            "3 documents: 3 errors, 0 warnings; later checks run after the errors are corrected",
        ),
    ],
)
def test_text_report(
    words: str, code: int, headlines: list[str], summary: str, capsys: Output
) -> None:
    """Findings on standard output in the order of the command line, the sum on standard error."""
    assert main(["validate", *words.split()]) == code
    output, errors = capsys.readouterr()
    found = [line for line in output.splitlines() if not line.startswith(" ")]
    assert len(found) == len(headlines)
    for line, headline in zip(found, headlines, strict=True):
        assert line.startswith(headline)
    assert errors == f"{summary}\n"


def test_json_report_has_the_same_keys_whatever_is_found(capsys: Output) -> None:
    """One object, nothing else on standard output or error."""
    for words, code, tests in (
        (["good.yaml"], 0, {"run": 1, "failed": 0}),
        (["failing.yaml", "good.yaml"], 1, {"run": 2, "failed": 1}),
        (["gone.yaml", "folder", "broken.yaml"], 1, {"run": 0, "failed": 0}),
        (["warned.yaml", "--no-tests"], 0, {"run": 0, "failed": 0}),
    ):
        assert main(["validate", "--format", "json", *words]) == code
        output, errors = capsys.readouterr()
        report = json.loads(output)
        assert errors == ""
        assert list(report) == [
            "files", "errors", "warnings", "more_may_follow", "tests", "coverage", "problems",
        ]  # fmt: skip
        assert report["tests"] == tests
        assert report["errors"] + report["warnings"] == len(report["problems"])
        for problem in report["problems"]:
            assert list(problem) == [
                "file", "line", "column", "end_column", "severity", "code", "path", "message",
                "hint",
            ]  # fmt: skip


def test_failed_test_is_reported_whole(capsys: Output) -> None:
    """Its line with a caret, and what was found."""
    main(["validate", "failing.yaml"])
    line = FAILING.splitlines()[16]
    assert capsys.readouterr().out == (
        "failing.yaml:17:5: error test-failed tests:"
        " test 'forty-two': battery: expected 43, found 42\n"
        f"   17 | {line}\n"
        "      |     ^\n"
    )


@pytest.mark.parametrize("kind", ["widgets/battery/widget.yaml", "widgets/value/widget.yaml"])
def test_every_kind_of_document_is_taken(kind: str, capsys: Output) -> None:
    """Widget manifests, drivers and interfaces are documents as robots are."""
    Path("face.yaml").write_text(
        "urc: 1\nkind: interface\nname: face\ngrid: |\n  a b\n", encoding="utf-8"
    )
    driver = "".join(f"{line}\n" for line in GOOD.splitlines() if "name: bot" not in line)
    driver = driver.replace("kind: robot", "kind: driver\nname: bot-driver")
    Path("driver.yaml").write_text(driver, encoding="utf-8")
    assert main(["validate", str(ROOT / kind), "face.yaml", "driver.yaml"]) == 0
    output, errors = capsys.readouterr()
    assert output == ""
    assert errors == "3 documents: 0 errors, 0 warnings, 1 of 1 test passed\n"


def modules_after(*words: str) -> set[str]:
    """Return the modules that a run of `urc` has imported, beyond those of the interpreter."""
    question = (
        "import sys; before = set(sys.modules); from urc.cli.main import main\n"
        "code = main(sys.argv[1:]); print(code, *(set(sys.modules) - before))"
    )
    # Isolated, as far as the checkout allows: what a .pth file imports is no business of ours.
    done = subprocess.run(
        [sys.executable, "-c", question, *words],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=30,
        check=True,
    )
    code, *modules = done.stdout.splitlines()[-1].split()
    assert code == "0", done.stderr
    return {name.partition(".")[0] for name in modules}


def test_version_imports_next_to_nothing() -> None:
    """It stays near a bare interpreter."""
    heavy = {"argparse", "asyncio", "dataclasses", "enum", "inspect", "pathlib", "re", "typing"}
    assert not modules_after("--version") & heavy


def test_validate_imports_only_what_a_good_document_needs() -> None:
    """No event loop, no template engine, no schema library, no web server."""
    heavy = {"asyncio", "jinja2", "jsonschema", "starlette", "uvicorn", "msgspec", "socket", "ssl"}
    slow = {"dataclasses", "inspect", "logging", "importlib_metadata"}
    assert not modules_after("validate", str(ROOT / "robots" / "puppet.yaml")) & (heavy | slow)


@pytest.mark.parametrize(
    ("reply", "said"),
    [
        ("OK", None),
        ("NO", "no-match: no declaration matches 'NO'"),
        ("ERR", "refused: the robot answered 'ERR'"),
    ],
)
def test_command_that_is_asked_and_answered_is_a_test(
    reply: str, said: str | None, capsys: pytest.CaptureFixture[str]
) -> None:
    """It holds when the command is done, and says why it is not; one without a reply is refused."""
    command = "commands: { go: { send: GO, reply: { equals: OK, errors: ['^ERR'] } } }\n"
    head = GOOD[: GOOD.index("tests:")].replace("name: bot\n", "name: asked\n")
    test = f'tests: [{{ name: go, run: go, feed: {{ wire: "{reply}\\n" }} }}]\n'
    Path("asked.yaml").write_text(head + command + test, "utf-8")
    assert main(["validate", "asked.yaml"]) == (said is not None)
    assert said is None or said in capsys.readouterr().out
    silent = "commands: { go: { send: GO } }\n"
    Path("asked.yaml").write_text(head + silent + test, "utf-8")
    assert main(["validate", "asked.yaml"]) == 1
    assert "this test cannot fail" in capsys.readouterr().out


def test_a_robot_is_checked_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """From any folder, as every other verb takes it."""
    monkeypatch.chdir(tmp_path)
    assert main(["validate", "puppet"]) == 0
    assert capsys.readouterr().err.startswith("1 document: 0 errors, 0 warnings")

"""`urc validate` for other programs, and what the documents' own tests leave out."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from urc.cli.main import main
from urc.config.codes import pages
from urc.config.report_formats import to_github, to_sarif
from urc.problems import Problem

Output = pytest.CaptureFixture[str]

ROBOT = """\
urc: 1
kind: robot
name: bot
transports:
  wire: { type: tcp, host: robot, port: 1, framing: { type: delimiter, tx: LF, rx: LF } }
signals:
  battery: { type: integer }
  mode: { type: string }
commands:
  go: { send: "GO", moves: true, confirm: { text: It goes } }
  halt: { send: "HALT" }
polls:
  - { name: battery, every: 1s, send: "?", reply: { regex: '^(?P<battery>\\d+)$' } }
messages:
  mode: { regex: '^M (?P<mode>\\w+)$' }
"""
TESTS = """\
tests:
  - { name: a, feed: { wire: "42\\n" }, reply_to: battery, expect: { battery: 42 } }
  - { name: b, run: go, sent: { wire: GO } }
"""
BOTH = """\
  - { name: c, run: halt, sent: { wire: HALT } }
  - { name: d, feed: { wire: "M on\\n" }, expect: { mode: "on" } }
"""


def keyed(required: list[str], **properties: object) -> dict[str, object]:
    return {"type": "object", "required": required, "properties": properties}


def listed(items: object) -> dict[str, object]:
    return {"type": "array", "minItems": 0, "items": items}


TEXT = {"type": "string", "minLength": 1}
MESSAGE = keyed(["text"], text=TEXT)
PLACE = {"type": "integer", "minimum": 1}
REGION = keyed(["startLine"], startLine=PLACE, startColumn=PLACE, endColumn=PLACE)
# The members that SARIF 2.1.0 requires, in the places where this log has them.
SARIF = keyed(
    ["version", "runs"],
    version={"const": "2.1.0"},
    runs=listed(
        keyed(
            ["tool", "results"],
            tool=keyed(
                ["driver"],
                driver=keyed(
                    ["name"], name=TEXT, rules=listed(keyed(["id"], id=TEXT, help=MESSAGE))
                ),
            ),
            columnKind={"enum": ["utf16CodeUnits", "unicodeCodePoints"]},
            results=listed(
                keyed(
                    ["message", "ruleId", "level", "locations"],
                    message=MESSAGE,
                    level={"enum": ["none", "note", "warning", "error"]},
                    ruleIndex={"type": "integer", "minimum": 0},
                    locations=listed(
                        keyed(
                            ["physicalLocation"],
                            physicalLocation=keyed(
                                ["artifactLocation", "region"],
                                artifactLocation=keyed(["uri"], uri=TEXT),
                                region=REGION,
                                contextRegion=REGION,
                            ),
                        )
                    ),
                )
            ),
        )
    ),
)


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("broken.yaml").write_text(ROBOT.replace("every", "evry"), "utf-8")
    for name, text in (("some", ROBOT + TESTS), ("all", ROBOT + TESTS + BOTH)):
        Path(f"{name}.yaml").write_text(text.replace("name: bot\n", f"name: {name}\n"), "utf-8")


def test_sarif_has_every_required_member_and_rules_that_the_results_name(capsys: Output) -> None:
    """One log of one run, whatever is found; the rules say what `urc explain` says first."""
    for words, code in (("all.yaml", 0), ("broken.yaml gone.yaml all.yaml", 1)):
        assert main(["validate", "--format", "sarif", *words.split()]) == code
        log: Any = json.loads(capsys.readouterr().out)
        jsonschema.Draft202012Validator(SARIF).validate(log)
        (run,) = log["runs"]
        rules = run["tool"]["driver"]["rules"]
        assert [rules[one["ruleIndex"]]["id"] for one in run["results"]] == [
            one["ruleId"] for one in run["results"]
        ]
        for rule in rules:
            assert rule["shortDescription"]["text"] == pages()[rule["id"]].what


def test_sarif_points_at_the_text() -> None:
    """File, line and columns, the line itself, the place in the document, and the remedy."""
    problem = Problem(
        "unknown-key",
        "no such key",
        "my robots/a%b.yaml",
        3,
        5,
        9,
        "signals.x",
        "try y",
        "    lo: 1",
    )
    log: Any = to_sarif([problem], "1.0", {})
    assert log["runs"][0]["results"] == [
        {
            "ruleId": "unknown-key",
            "ruleIndex": 0,
            "level": "error",
            "message": {"text": "no such key\ntry y"},
            "locations": [
                {
                    "physicalLocation": {
                        "artifactLocation": {"uri": "my%20robots/a%25b.yaml"},
                        "region": {"startLine": 3, "startColumn": 5, "endColumn": 9},
                        "contextRegion": {"startLine": 3, "snippet": {"text": "    lo: 1"}},
                    },
                    "logicalLocations": [{"fullyQualifiedName": "signals.x"}],
                }
            ],
        }
    ]


def test_absolute_path_becomes_a_uri() -> None:
    """A path such as /a b.yaml is file:///a%20b.yaml."""
    log: Any = to_sarif([Problem("tab", "a tab", str(Path("/a b.yaml").absolute()))], "1.0", {})
    physical = log["runs"][0]["results"][0]["locations"][0]["physicalLocation"]
    assert physical["artifactLocation"]["uri"].endswith("/a%20b.yaml")
    assert physical["artifactLocation"]["uri"].startswith("file:///")


@pytest.mark.parametrize(
    ("problem", "line"),
    [
        (
            Problem("tab", "a tab", "a.yaml", 2, 3, 5),
            "::error file=a.yaml,line=2,endLine=2,col=3,endColumn=5,title=urc tab::a tab",
        ),
        (
            Problem("tab", "50 % of\ntwo", "a,b:c%.yaml", 1, 1, path="x.y", severity="warning"),
            "::warning file=a%2Cb%3Ac%25.yaml,line=1,endLine=1,col=1,endColumn=2,title=urc tab"
            "::x.y: 50 %25 of\\x0atwo",
        ),
        (
            Problem("tab", "::error::x", "a.yaml", hint="a: b, c"),
            "::error file=a.yaml,line=1,endLine=1,col=1,endColumn=2,title=urc tab"
            "::::error::x%0Aa: b, c",
        ),
    ],
)
def test_github_annotation_is_one_line_that_nothing_breaks_out_of(
    problem: Problem, line: str
) -> None:
    """Per cent signs, line ends, commas and colons are escaped where they would mean something."""
    assert to_github(problem) == line


def test_github_report_goes_to_standard_output(capsys: Output) -> None:
    """A workflow command per finding; the sum for people goes beside it."""
    assert main(["validate", "--format", "github", "broken.yaml"]) == 1
    output, errors = capsys.readouterr()
    assert {line.partition(" ")[0] for line in output.splitlines()} == {"::error"}
    assert errors.startswith("1 document: ")


def test_summary_names_what_has_no_test(capsys: Output) -> None:
    """It is no warning: the exit code is 0, even with --strict."""
    assert main(["validate", "--strict", "some.yaml"]) == 0
    output, errors = capsys.readouterr()
    assert output == ""
    assert errors == (
        "1 document: 0 errors, 0 warnings, 2 of 2 tests passed,"
        " no test of command halt, message mode\n"
    )


def test_coverage_lists_what_has_no_test(capsys: Output) -> None:
    """A line for the document, and one for each command, poll and message without a test."""
    assert main(["validate", "--coverage", "some.yaml", "all.yaml"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "some.yaml: 2 of 4 commands, polls and messages tested",
        "  no test of command halt",
        "  no test of message mode",
        "all.yaml: 4 of 4 commands, polls and messages tested",
    ]


def test_json_has_the_coverage(capsys: Output) -> None:
    """For each profile whose tests were run."""
    assert main(["validate", "--format", "json", "some.yaml", "broken.yaml"]) == 1
    assert json.loads(capsys.readouterr().out)["coverage"] == [
        {
            "file": "some.yaml",
            "total": 4,
            "untested": [
                {"kind": "command", "name": "halt"},
                {"kind": "message", "name": "mode"},
            ],
        }
    ]

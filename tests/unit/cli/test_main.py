"""The `urc` command as a function: verbs, exit codes, and failures told in one line."""

import argparse
import errno
import json
import re
import sys
from datetime import UTC, datetime
from pathlib import Path
from types import ModuleType

import jsonschema
import pytest
import yaml

from urc.access.authority import CertificateAuthority
from urc.cli import main as main_module
from urc.cli import send as send_module
from urc.cli.demo import has_screen
from urc.cli.error_report import Misuse, explain
from urc.cli.main import VERBS, main
from urc.cli.output import json_text
from urc.model.driver import Argument, Command
from urc.problems import Problem, ProblemsError, UrcError
from urc.shipped import shipped
from urc.testing.profile import text as text_form

Output = pytest.CaptureFixture[str]


def test_no_words_is_wrong_use_and_says_what_to_do_next(capsys: Output) -> None:
    """A few first steps, each with a subcommand that exists."""
    assert main([]) == 2
    output, steps = capsys.readouterr()
    assert output == ""
    named = re.findall(r"^  urc ([a-z]+)", steps, re.MULTILINE)
    assert named[0] == "demo"
    assert VERBS.keys() > {*named}
    assert "'urc --help' lists all subcommands" in steps


@pytest.mark.parametrize("words", [["--help"], ["-h"], ["help"]])
def test_help_lists_every_subcommand(words: list[str], capsys: Output) -> None:
    """The answer to a question goes to standard output."""
    assert main(words) == 0
    usage, errors = capsys.readouterr()
    assert errors == ""
    for verb, summary in VERBS.items():
        assert re.search(rf"^  {verb} +{re.escape(summary)}$", usage, re.MULTILINE)


@pytest.mark.parametrize("verb", VERBS)
def test_help_of_a_verb_can_be_asked_for_in_two_ways(verb: str, capsys: Output) -> None:
    """`urc help watch` and `urc watch --help`."""
    assert main([verb, "--help"]) == 0
    told = capsys.readouterr()
    assert main(["help", verb]) == 0
    assert capsys.readouterr() == told
    assert told.err == ""


@pytest.mark.parametrize(
    ("word", "hint"),
    [("wach", "did you mean 'watch'?"), ("x", "'urc --help' lists all subcommands")],
)
def test_unknown_verb_is_told_with_a_suggestion(word: str, hint: str, capsys: Output) -> None:
    """Exit code 2: wrong use."""
    assert main([word]) == 2
    assert capsys.readouterr() == ("", f"urc: unknown subcommand '{word}'; {hint}\n")


CASES: list[tuple[BaseException, int, str]] = [
    (UrcError("the robot\nis gone"), 1, r"urc watch: the robot\x0ais gone"),
    (Misuse("no such signal"), 2, "urc watch: no such signal"),
    (
        ProblemsError([Problem("odd", "it is odd", "a.yaml", 2, 3), Problem("even", "it is", "b")]),
        1,
        "a.yaml:2:3: error odd: it is odd\nb:1:1: error even: it is",
    ),
    (
        ModuleNotFoundError("No module named 'yaml'", name="yaml"),
        1,
        "urc watch: yaml is not installed; 'urc doctor' lists missing packages",
    ),
    (PermissionError(errno.EACCES, "Permission denied", "x"), 1, "urc watch: x: Permission denied"),
    (OSError("odd"), 1, "urc watch: odd"),
    (
        ValueError("two\nlines"),
        1,
        "urc watch: this is a bug in URC; please report it: ValueError at FILE: two\\x0alines",
    ),
    (BrokenPipeError(), 0, ""),
    (KeyboardInterrupt(), 130, ""),
]


@pytest.mark.parametrize(("error", "code", "line"), CASES, ids=lambda case: type(case).__name__)
def test_failure_of_a_verb_is_told_without_a_traceback(
    error: BaseException, code: int, line: str, capsys: Output, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever happens, there is a line for people and an exit code for programs."""

    def fail(arguments: argparse.Namespace) -> int:
        raise error

    verb = ModuleType("urc.cli.watch")
    verb.__dict__.update(EXAMPLE="", add_arguments=lambda parser: None, run=fail)
    monkeypatch.setitem(sys.modules, "urc.cli.watch", verb)
    monkeypatch.setattr(main_module, "_discard_output", lambda: None)
    assert main(["watch"]) == code
    output, errors = capsys.readouterr()
    place = re.escape(str(Path(__file__).with_suffix(""))) + r"\.py:\d+"
    assert (output, re.sub(place, "FILE", errors)) == ("", f"{line}\n" if line else "")


def test_mistake_without_a_place_is_told_too(capsys: Output) -> None:
    """An exception that was never raised has no traceback."""
    assert explain(KeyError("x"), "urc") == 1
    expected = "urc: this is a bug in URC; please report it: KeyError: 'x'\n"
    assert capsys.readouterr().err == expected


@pytest.mark.parametrize("kind", ["robot", "driver", "interface", "widget"])
def test_schema_is_printed_whole_in_itself(kind: str, capsys: Output) -> None:
    """Saved beside nothing else it judges as the shipped files do together."""
    assert main(["schema", kind]) == 0
    schema = json.loads(capsys.readouterr().out)
    judge = jsonschema.Draft202012Validator(schema)
    references = set(re.findall(r'"\$ref": "([^#"]*)#', json.dumps(schema)))
    assert references == {""}
    assert any(judge.iter_errors({"urc": 1, "kind": kind, "name": "x", "nonsense": 1}))
    if kind == "robot":
        puppet = yaml.safe_load((shipped("robots") / "puppet.yaml").read_text("utf-8"))
        assert list(judge.iter_errors(puppet)) == []


def test_schema_says_where_its_file_is(capsys: Output) -> None:
    """Editors want the file, beside those that it refers to."""
    assert main(["schema", "robot", "--path"]) == 0
    assert capsys.readouterr().out == f"{shipped('schemas') / 'robot.schema.json'}\n"
    assert main(["schema", "--path"]) == 0
    assert capsys.readouterr().out == f"{shipped('schemas')}\n"


def test_schema_of_nothing_is_wrong_use(capsys: Output) -> None:
    """The line says what there is."""
    assert main(["schema"]) == 2
    kinds = "robot, driver, interface, widget, site-rules"
    expected = f"urc schema: KIND is missing: expected one of {kinds}\n"
    assert capsys.readouterr() == ("", expected)


@pytest.mark.parametrize(
    ("words", "code", "line"),
    [
        (
            ("watch", "nobody"),
            1,
            "urc watch: no file or robot has the name 'nobody'; known robots: ",
        ),
        (("watch", "gone.yaml"), 1, "gone.yaml:1:1: error no-such-file: there is no such file"),
        (
            ("watch", "puppet", "batery"),
            2,
            "urc watch: puppet has no signal 'batery'; did you mean 'battery'?",
        ),
        (("watch", "puppet", "xyz"), 2, "urc watch: puppet has no signal 'xyz'; it has: battery"),
        (
            ("send", "puppet", "go"),
            2,
            "urc send: puppet has no command 'go'; it has: none",
        ),
        (
            ("serve", "puppet", "puppet"),
            2,
            "urc serve: two robots have the name 'puppet'; each name must be unique",
        ),
        (
            ("simulate", "puppet", "--set", "port=x"),
            2,
            "urc simulate: --set port: 'x' is not a port from 0 to 65535",
        ),
    ],
)
def test_what_is_not_there_is_told(
    words: tuple[str, ...], code: int, line: str, capsys: Output
) -> None:
    """Before anything is connected or listened on."""
    assert main(list(words)) == code
    output, errors = capsys.readouterr()
    assert output == ""
    assert errors.startswith(line)
    assert errors.count("\n") == 1


ARGUMENTS = {
    "n": Argument("n", "integer"),
    "x": Argument("x", "number"),
    "b": Argument("b", "boolean"),
    "s": Argument("s", "string"),
}
COMMAND = Command("move", "wire", text_form("move"), arguments=ARGUMENTS)


def test_arguments_of_a_command_are_typed() -> None:
    """By the driver's declaration; text may hold an equals sign, or nothing."""
    words = ["n=-0x1f", "x=1e-3", "b=true", "s=a=b"]
    assert send_module._arguments(COMMAND, words) == {"n": -31, "x": 0.001, "b": True, "s": "a=b"}
    assert send_module._arguments(COMMAND, ["b=false", "s="]) == {"b": False, "s": ""}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["12"], "expected ARG=VALUE, such as 'n=12'; found '12'"),
        (["m=1"], "move has no argument 'm'; it has: n, x, b, s"),
        (["n=1", "n=2"], "n appears twice"),
        (["n=1.5"], "n: expected integer, found '1.5'"),
        (["x=fast"], "x: expected number, found 'fast'"),
        (["b=yes"], "b: expected true or false, found 'yes'"),
    ],
)
def test_wrong_arguments_of_a_command_are_wrong_use(words: list[str], message: str) -> None:
    """One line each."""
    with pytest.raises(Misuse) as told:
        send_module._arguments(COMMAND, words)
    assert str(told.value) == message


def test_json_takes_every_kind_of_reading(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bytes are base64; what the output's encoding lacks is escaped."""
    value = {"blob": b"\x00\xff", "list": (1, None, True), "text": "21 °C \ud800", "map": {}}
    assert json.loads(json_text(value)) == value | {"blob": "AP8=", "list": [1, None, True]}

    class Latin:
        encoding = "latin-1"

    monkeypatch.setattr(sys, "stdout", Latin())
    assert json_text({"unit": "°漢"}) == r'{"unit": "\u00b0\u6f22"}'


@pytest.mark.parametrize(
    ("platform", "environment", "opens"),
    [
        ("win32", {}, True),
        ("darwin", {}, True),
        ("linux", {}, False),
        ("linux", {"DISPLAY": ""}, False),
        ("linux", {"DISPLAY": ":0"}, True),
        ("linux", {"WAYLAND_DISPLAY": "wayland-0"}, True),
    ],
)
def test_browser_is_opened_only_where_there_is_a_screen(
    platform: str, environment: dict[str, str], opens: bool
) -> None:
    """In a bare terminal a text browser would take the terminal over."""
    assert has_screen(platform, environment) is opens


def test_doctor_tells_what_is_missing(
    capsys: Output, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A package, a folder, and a robot that cannot be loaded: 1, and a line for each."""
    from urc.cli import doctor

    def broken() -> str:
        raise ImportError("No module named 'yaml'")

    monkeypatch.setattr(doctor, "REQUIRED", {"no-such-package-here": "does much"})
    monkeypatch.setattr(doctor, "OPTIONAL", {"nor-this": "does more"})
    monkeypatch.setattr(doctor, "EXTRAS", {"not-even-this": ("demo", "does most")})
    monkeypatch.setattr(doctor, "shipped", lambda _: tmp_path)
    monkeypatch.setattr(doctor, "_load_robots", broken)
    assert main(["doctor", "--port", "0"]) == 1
    output, errors = capsys.readouterr()
    for line in (
        "MISSING no-such-package-here  not installed: does much",
        "note    nor-this              not installed: does more",
        f"MISSING robots/               not at {tmp_path}",
        "MISSING robots                No module named 'yaml'",
    ):
        assert line in output.splitlines()
    assert errors == "urc doctor: 6 of 16 checks failed\n"


def test_doctor_shows_the_authority(
    capsys: Output, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its fingerprint and its end, to compare with a device; a damaged file is a note."""
    from urc.cli import doctor

    monkeypatch.setattr(doctor, "_load_robots", lambda: "not looked at here")

    def line() -> str:
        main(["doctor", "--port", "0", "--data-dir", str(tmp_path)])
        output, _ = capsys.readouterr()
        return next(one for one in output.splitlines() if one.split()[1] == "authority")

    assert "ok " in line()
    assert not (tmp_path / "tls").exists()
    made = CertificateAuthority(tmp_path / "tls", ["localhost"], datetime.now(UTC))
    assert f"{made.fingerprint}, until 20" in line()
    made.file.write_text("nonsense")
    assert line().startswith("note ")
    assert "authority.pem cannot be used: expected a certificate in PEM" in line()

"""`urc validate` on a widget: its template, its module and its demo count as its manifest does."""

from pathlib import Path

import pytest

from urc.cli import dashboard
from urc.cli.main import main

Output = pytest.CaptureFixture[str]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Output) -> Path:
    """Return the folder of a sound widget."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "widget", "throttle"]) == 0
    capsys.readouterr()
    return Path("widgets/throttle")


def test_a_sound_widget_has_no_findings(folder: Path, capsys: Output) -> None:
    """Named by its manifest or by its folder."""
    assert main(["validate", str(folder / "widget.yaml"), str(folder)]) == 0
    assert capsys.readouterr() == ("", "1 document: 0 errors, 0 warnings\n")


@pytest.mark.parametrize(
    ("name", "before", "after", "found"),
    [
        ("template.html.j2", "{% endif %}", "", ": error bad-template: "),
        (
            "template.html.j2",
            "options.label",
            "optons.label",
            ": error unknown-name: templates have no",
        ),
        ("template.html.j2", "options.label", "options.lable", "not among the options in the man"),
        ("template.html.j2", "options.label", "options['lable']", "not among the options in the"),
        ("template.html.j2", "options.label", "options.label | upercase", "No filter named"),
        ("template.html.j2", "options.label", "inputs.value.titel", "in the state 'normal'"),
        ("demo.yaml", "{ value: 12.5 }, shows", "{ valu: 12.5 }, shows", "states.normal.values"),
        ("demo.yaml", "shows:", "shws:", ":38: error unknown-key states.normal.shws: "),
        ("demo.yaml", "  normal:", "  usual:", "error missing-key states: 'normal' is missing"),
        ("demo.yaml", "  normal:", "  norm:", "error missing-key states: 'normal' is missing"),
        ("demo.yaml", "  normal: {", "  normal: {{", "demo.yaml:"),
        ("widget.js", "export default", "export defalt", "widget.js:6:1: error no-default-export"),
        ("widget.js", "export default", "// export default", "widget.js:1:1: error no-default"),
    ],
)
def test_a_mistake_in_any_file_is_found(
    folder: Path, capsys: Output, name: str, before: str, after: str, found: str
) -> None:
    """Its line is shown, and the command fails."""
    file = folder / name
    text = file.read_text("utf-8")
    assert before in text
    file.write_text(text.replace(before, after, 1), "utf-8")
    assert main(["validate", str(folder / "widget.yaml")]) == 1
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith(f"{file}:")
    assert found in first


def test_the_line_of_a_fault_in_a_template_is_told(folder: Path, capsys: Output) -> None:
    """Also where only a state of the demo brings it about."""
    file = folder / "template.html.j2"
    lines = file.read_text("utf-8").splitlines()
    file.write_text("\n".join([*lines, "{{ optons }}"]), "utf-8")
    assert main(["validate", str(folder)]) == 1
    assert f"{file}:{len(lines) + 1}:4: error unknown-name" in capsys.readouterr().out
    file.write_text("\n".join([*lines, "{{ inputs.value.titel }}"]), "utf-8")
    assert main(["validate", str(folder)]) == 1
    assert f"{file}:{len(lines) + 1}:1: error bad-template" in capsys.readouterr().out


def test_a_name_that_is_asked_for_first_is_no_mistake(folder: Path) -> None:
    """The template says itself that it need not be there."""
    file = folder / "template.html.j2"
    asking = "{% if more is defined %}x{% endif %}{{ options.other | default('') }}"
    file.write_text(file.read_text("utf-8") + asking, "utf-8")
    assert main(["validate", str(folder)]) == 0


@pytest.mark.parametrize("name", ["template.html.j2", "widget.js", "demo.yaml"])
def test_a_file_that_is_missing_is_found(folder: Path, capsys: Output, name: str) -> None:
    """Each of them is needed."""
    (folder / name).unlink()
    assert main(["validate", str(folder)]) == 1
    assert f"{folder / name}:1:1: error no-such-file" in capsys.readouterr().out


@pytest.mark.parametrize("text", ["export { one as default };", "let a={};export default a"])
def test_a_default_export_has_several_forms(folder: Path, text: str) -> None:
    """None of them is refused."""
    (folder / "widget.js").write_text(text, "utf-8")
    assert main(["validate", str(folder)]) == 0


def test_all_shipped_widgets_are_sound(capsys: Output) -> None:
    """What is asked of authors holds for URC's own."""
    root = Path(__file__).resolve().parents[3]
    assert main(["validate", *map(str, sorted((root / "widgets").glob("*/widget.yaml")))]) == 0
    assert capsys.readouterr().out == ""


ROBOT = """\
urc: 1
kind: robot
name: bot
transports:
  wire: { type: tcp, host: 127.0.0.1, port: 9, framing: { type: delimiter, tx: LF, rx: LF } }
signals:
  battery: { type: integer }
messages:
  state: { regex: '^(?P<battery>[0-9]+)$' }
widgets:
  dial: { use: gauge, bind: { value: battery } }
interfaces:
  default: { grid: dial }
"""


def test_a_widget_that_is_never_used_is_told(
    folder: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By its own folder, by a robot that uses the shipped one in its place, and when it is served.

    The dashboard itself is left out.
    """
    own = folder.rename(folder.parent / "gauge")
    manifest = own / "widget.yaml"
    manifest.write_text(manifest.read_text("utf-8").replace("name: throttle", "name: gauge"))
    Path("bot.yaml").write_text(ROBOT, "utf-8")
    for path in (own, Path("bot.yaml")):
        assert main(["validate", str(path)]) == 0
        output = capsys.readouterr().out
        assert f"{manifest}:1:1: warning shipped-name: this widget is never used" in output
    monkeypatch.setattr(dashboard, "run_dashboard", lambda *_, **__: 0)
    assert main(["serve", "bot.yaml"]) == 0
    assert capsys.readouterr().err == (
        f"urc serve: {own} is ignored: a widget with this name ships with URC\n"
    )


def test_what_is_wrong_with_the_widgets_of_a_robot_is_found_with_the_robot(
    folder: Path, capsys: Output
) -> None:
    """Nobody has to name each folder: its page would show a card in that place."""
    Path("bot.yaml").write_text(
        "urc: 1\nkind: robot\nname: bot\n"
        "transports: { wire: { type: tcp, host: 127.0.0.1, port: 1,"
        " framing: { type: delimiter, tx: LF, rx: LF } } }\n"
        "signals: { level: { type: number } }\n"
        "messages: { level: { regex: '^L (?P<level>[0-9]+)$' } }\n"
        "widgets: { tank: { use: throttle, bind: { value: level } } }\n"
        "interfaces: { default: { grid: tank } }\n",
        "utf-8",
    )
    main(["validate", "bot.yaml"])
    assert "throttle" not in capsys.readouterr().out
    (folder / "widget.js").unlink()
    assert main(["validate", "bot.yaml"]) == 1
    assert "widgets/throttle/widget.js" in capsys.readouterr().out

"""`urc migrate`: old names of keys and values in a document, and not one byte beside them."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc.cli.main import main
from urc.config.load import WidgetFolder, check
from urc.config.migrate import migrate
from urc.config.renames import CODES, KEYS, VALUES
from urc.problems import Problem, ProblemsError
from urc.runtime.registries import built_in_catalog
from urc.shipped import shipped

WIRE = "{ type: tcp, host: h, port: 1, framing: { type: delimiter, tx: LF, rx: LF }"
PORT = "{ type: array, description: It. "
HEADS = {
    "driver": "urc: 1\nkind: driver\npartial: true\n",
    "interface": "urc: 1\nkind: interface\npartial: true\n",
    "widget": "urc: 1\nkind: widget\nname: dial\ntitle: Dial\nsummary: A dial.\n",
}
# Part of the language and old name → a document with that key, written as KEY.
SNIPPETS = {
    ("interface", "grids"): "KEY: { landscape: a }\n",
    ("interface", "left"): "grid: a\nKEY: { landscape: a }\n",
    ("interface", "wide"): "layouts: { KEY: a }\n",
    ("interface", "tall"): "tabs: { one: { layouts: { landscape: a, KEY: a } } }\n",
    ("interface", "phone"): "grid: a\nleft_handed: { KEY: a }\n",
    ("interface", "low"): "layouts: { landscape: a, KEY: a }\n",
    ("driver", "via"): f"transports: {{ wire: {WIRE}, KEY: jump }} }}\n",
    ("driver", "ros"): "transports: { bridge: { type: ros, host: h, KEY: 2 } }\n",
    ("driver", "answers"): f"transports: {{ wire: {WIRE}, KEY: never }} }}\n",
    ("driver", "answer_timeout"): 'transports: { a: { type: http, url: "http://h/", KEY: 2s } }\n',
    (
        "driver",
        "alive_every",
    ): "transports: { a: { type: ssh, mode: forward, host: h, KEY: 2s } }\n",
    ("driver", "ping_every"): 'transports: { a: { type: websocket, url: "ws://h/", KEY: 2s } }\n',
    ("driver", "answer"): "messages: { ping: { equals: PING, KEY: PONG } }\n",
    ("driver", "most"): (
        "messages: { point: { regex: '^(?P<_r>.)$', collect: { r: { value: _r, KEY: 9 } } } }\n"
    ),
    ("driver", "of"): "signals: { joints: { type: array, KEY: number } }\n",
    ("driver", "plan"): "simulator: { world: { KEY: { ground: grass } } }\n",
    ("driver", "view"): "simulator: { world: { camera: { KEY: 70 } } }\n",
    ("driver", "up"): "simulator: { world: { camera: { KEY: 0.3 } } }\n",
    ("widget", "needs"): f"inputs: {{ a: {PORT}}} }}\nKEY: [a]\n",
    ("widget", "together"): f"inputs: {{ a: {PORT}}}, b: {PORT}}} }}\nKEY: [[a, b]]\n",
    ("widget", "gate"): "KEY: true\n",
    ("widget", "of"): f"inputs: {{ a: {PORT}, KEY: number }} }}\n",
    ("widget", "each"): f"inputs: {{ a: {PORT}, KEY: true }} }}\n",
    ("widget", "many"): f"inputs: {{ a: {PORT}, KEY: true }} }}\n",
    ("widget", "instead_of"): f"inputs: {{ a: {PORT}, KEY: [b] }}, b: {PORT}}} }}\n",
    ("widget", "below"): (
        "options:\n  low: { type: number, KEY: high, description: It. }\n"
        "  high: { type: number, description: It. }\n"
    ),
    ("widget", "gives"): (
        "outputs: { go: { description: It. } }\n"
        "options: { a: { type: array, description: It., items: "
        "{ type: string, description: It., KEY: go } } }\n"
    ),
    ("widget", "local"): "options: { page: { type: string, KEY: true, description: It. } }\n",
}
MIXED = """\
# via, of, grids: a comment stays.
urc: 1
kind: robot
name: rover # rosbridge
title: "of via"
transports:
  jump: { type: ssh, mode: forward, host: h }
  via: { "type": 'rosbridge', "via": jump, 'ros': 2, host: "h" }   # via
  own: { type: pigeon, ros: 1, ping_every: 3 }
signals:
  of: { type: array, of: number, states: { of: via } }
  many: &many { type: array,   of:   integer }
  again: *many
commands:
  answer: { send: "of: {{ of }}", args: { of: { type: array, of: number } } }
simulator:
  rules:
    via: [{ command: answer, answer: none }]
interfaces:
  wide:
    grids: { low: of }
    widgets: { of: { use: value, bind: { many: of }, options: { of: 1, below: 2 } } }
tests:
  - { name: t, steps: [{ run: answer, args: { of: [1] }, fails: silent, of: answer }] }
"""
MIXED_AFTER = """\
# via, of, grids: a comment stays.
urc: 1
kind: robot
name: rover # rosbridge
title: "of via"
transports:
  jump: { type: ssh, mode: forward, host: h }
  via: { "type": 'ros', "tunnel": jump, 'version': 2, host: "h" }   # via
  own: { type: pigeon, ros: 1, ping_every: 3 }
signals:
  of: { type: array, items: number, states: { of: via } }
  many: &many { type: array,   items:   integer }
  again: *many
commands:
  answer: { send: "of: {{ of }}", args: { of: { type: array, items: number } } }
simulator:
  rules:
    via: [{ command: answer, answer: none }]
interfaces:
  wide:
    layouts: { phone_landscape: of }
    widgets: { of: { use: value, bind: { many: of }, options: { of: 1, below: 2 } } }
tests:
  - { name: t, steps: [{ run: answer, args: { of: [1] }, fails: no-data, of: answer }] }
"""


def migrated(folder: Path, text: str | bytes, name: str = "x.yaml") -> str:
    """Return a text under the present names, which stay when it is migrated again."""
    file = folder / name
    content = text.encode() if isinstance(text, str) else text
    file.write_bytes(content)
    once = migrate(str(file)).content
    file.write_bytes(once)
    assert migrate(str(file)) == (once, ())
    return once.decode()


def problems(folder: Path, text: str, name: str) -> tuple[Problem, ...]:
    file = folder / name
    file.parent.mkdir(exist_ok=True)
    file.write_text(text, "utf-8")
    return check(str(file), built_in_catalog(), WidgetFolder(shipped("widgets"))).problems


def test_each_renamed_key_has_a_document() -> None:
    """Those of a demo have a test of their own."""
    renamed = {(one.content, one.old) for one in KEYS if one.content != "demo"}
    assert SNIPPETS.keys() == renamed


@pytest.mark.parametrize(
    "rename", [one for one in KEYS if one.content != "demo"], ids=lambda one: one.old
)
def test_an_old_key_is_told_with_its_new_name_and_migrated(tmp_path: Path, rename) -> None:  # type: ignore[no-untyped-def]  # a row of the table
    """The old name is an unknown key, whose hint says the new one; the new name is known."""
    text = HEADS[rename.content] + SNIPPETS[rename.content, rename.old]
    old, new = text.replace("KEY", rename.old), text.replace("KEY", rename.new)
    name = "dial/widget.yaml" if rename.content == "widget" else "x.yaml"
    assert migrated(tmp_path, old) == new
    hints = [one.hint for one in problems(tmp_path, old, name) if one.code == "unknown-key"]
    assert hints == [f"the new name is '{rename.new}'; 'urc migrate' replaces old names"]
    assert "unknown-key" not in {one.code for one in problems(tmp_path, new, name)}


def test_an_old_type_of_transport_is_told_with_its_new_name(tmp_path: Path) -> None:
    """The type of a transport is a value."""
    text = "urc: 1\nkind: robot\nname: x\ntransports: { a: { type: rosbridge, host: h } }\n"
    told = [one.hint for one in problems(tmp_path, text, "x.yaml")]
    assert "the new name is 'ros'; 'urc migrate' replaces old names" in told
    assert migrated(tmp_path, text) == text.replace("rosbridge", "ros")


def test_values_of_the_table() -> None:
    """Each is in `MIXED`."""
    assert [one.old for one in VALUES] == ["rosbridge", "silent"]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("start", ["", "\ufeff"])
def test_names_of_a_person_comments_quotes_and_line_ends_stay(
    tmp_path: Path, end: str, start: str
) -> None:
    """Signals, commands, arguments and options may be called like an old key."""
    before, after = (start + text.replace("\n", end) for text in (MIXED, MIXED_AFTER))
    assert migrated(tmp_path, before) == after


def test_via_of_a_ros_transport_is_no_old_key(tmp_path: Path) -> None:
    """It says how URC reaches ROS; without a type, its one value tells it apart."""
    text = HEADS["driver"] + "transports: { a: { type: ros, via: rosbridge }, b: { VIA } }\n"
    assert migrated(tmp_path, text.replace("VIA", "via: rosbridge")) == text.replace(
        "VIA", "via: rosbridge"
    )
    assert migrated(tmp_path, text.replace("VIA", "via: jump")) == text.replace(
        "VIA", "tunnel: jump"
    )


def test_drivers_and_interfaces_in_a_robot_are_migrated(tmp_path: Path) -> None:
    """At the top, under `driver`, under its `overrides`, and in each interface."""
    part = "signals: { a: { type: array, of: number } }"
    for place in ("{}", "driver: {{ {} }}", "driver: {{ use: x, overrides: {{ {} }} }}"):
        text = "urc: 1\nkind: robot\nname: x\n" + place.format(part) + "\n"
        assert migrated(tmp_path, text) == text.replace("of:", "items:")


def test_a_demo_of_a_widget_is_migrated(tmp_path: Path) -> None:
    """It has no `kind`; its name tells what it is."""
    text = (
        "signals: { a: { type: array, of: number } }\n"
        "outputs: { go: { command: c, arguments: { of: { type: array, of: number } } } }\n"
        "states: { of: { values: {} } }\n"
    )
    after = text.replace("array, of", "array, items")
    assert migrated(tmp_path, text, "demo.yaml") == after
    with pytest.raises(ProblemsError, match="no known 'kind'"):
        migrated(tmp_path, text)


def test_both_names_of_a_key_are_a_problem(tmp_path: Path) -> None:
    """Renaming would write one key twice."""
    text = HEADS["interface"] + "grids: { landscape: a }\nlayouts: { landscape: b }\n"
    with pytest.raises(ProblemsError, match="'grids' is the old name of 'layouts'"):
        migrated(tmp_path, text)


@given(
    names=st.lists(
        st.sampled_from(sorted({one.old for one in KEYS})), unique=True, min_size=1, max_size=6
    ),
    indent=st.integers(1, 4),
    end=st.sampled_from(["\n", "\r\n"]),
    words=st.text(st.characters(exclude_categories=("C", "Z"), exclude_characters="#"), max_size=9),
)
def test_only_renamed_bytes_change(
    tmp_path_factory: pytest.TempPathFactory, names: list[str], indent: int, end: str, words: str
) -> None:
    """What is not renamed is the same before and after, whatever stands around it."""
    pad = " " * indent
    lines = ["urc: 1", "kind: driver", 'summary: "a\u2028  b"', "signals:", f"# {words} ü"]
    for name in names:
        lines += [
            f"{pad}{name}:   # of: {words}",
            f'{pad}{pad}"of" : number',
            f"{pad * 2}type: array",
        ]
    text = end.join([*lines, f"title: >{end}  of {words}", ""])
    after = text.replace('"of" :', '"items" :')
    assert migrated(tmp_path_factory.mktemp("a"), text) == after


def test_it_prints_a_line_for_each_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A check changes nothing, and ends with 1 when something would change."""
    monkeypatch.chdir(tmp_path)
    text = HEADS["interface"] + "grids: { wide: a }\n"
    Path("i.yaml").write_text(text, "utf-8")
    Path("link.yaml").symlink_to("i.yaml")
    Path("i.yaml").chmod(0o640)
    names = "grids → layouts (line 4), wide → landscape (line 4)"
    assert main(["migrate", "--check", "i.yaml"]) == 1
    assert Path("i.yaml").read_text("utf-8") == text
    assert main(["migrate", "link.yaml"]) == 0
    assert main(["migrate", "--check", "i.yaml", "link.yaml"]) == 0
    assert capsys.readouterr() == (
        f"i.yaml: would rename {names}\nlink.yaml: renamed {names}\n"
        "i.yaml: nothing to rename\nlink.yaml: nothing to rename\n",
        "",
    )
    assert Path("link.yaml").is_symlink()
    assert Path("i.yaml").stat().st_mode & 0o777 == 0o640
    assert sorted(path.name for path in tmp_path.iterdir()) == ["i.yaml", "link.yaml"]


def test_what_is_no_document_is_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The other files are migrated all the same."""
    monkeypatch.chdir(tmp_path)
    Path("bad.yaml").write_text("a: [", "utf-8")
    Path("good.yaml").write_text(HEADS["widget"] + "gate: true\n", "utf-8")
    assert main(["migrate", "bad.yaml", "gone.yaml", "good.yaml"]) == 1
    output, errors = capsys.readouterr()
    assert output == "good.yaml: renamed gate → dead_man (line 6)\n"
    bad, gone = errors.splitlines()
    assert bad.startswith("bad.yaml:1:")
    assert gone == "gone.yaml:1:1: error no-such-file: there is no such file"
    assert main(["migrate"]) == 2


@pytest.mark.parametrize(("old", "new"), CODES.items())
def test_an_old_code_is_explained_under_its_new_name(
    old: str, new: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """People have it in notes and in logs."""
    assert main(["explain", new]) == 0
    page = capsys.readouterr().out
    assert main(["explain", old]) == 0
    assert capsys.readouterr().out == f"The new name of {old} is {new}.\n\n{page}"

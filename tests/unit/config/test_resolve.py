"""Params, overrides, and a profile put together into one document."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.config.folder import SHELF, WIRE, Folder, head
from urc.config.compose.merge import count_nodes
from urc.config.gather import gather
from urc.config.parse.widget import WidgetFolder
from urc.config.resolve import resolve, written
from urc.source import parse_document


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    return Folder(tmp_path)


# ---- params and overrides


def test_params_are_filled_in_before_anything_else(folder: Folder) -> None:
    """In keys, texts and values; a driver alone takes the default, or a sample."""
    folder.write(
        line=head("driver", "line")
        + "params:\n  id: { type: integer, min: 3 }\n  side: { default: left }\n"
        + WIRE
        + 'signals:\n  "{params.side}": { max: "{params.id}" }\n'
        + 'messages: { all: { regex: "^{params.id} (?P<{params.side}>.)$" } }\n',
        bot=head("robot", "bot") + "driver: { use: line.yaml, params: { id: 17, side: right } }\n",
    )
    alone = folder.check("line").profile
    assert alone is not None
    assert alone.driver.signals["left"].max == 3
    profile = folder.check("bot").profile
    assert profile is not None
    assert profile.driver.signals["right"].max == 17
    assert folder.found("bot") == []


@pytest.mark.parametrize("other", ["right: { max: 1 }", "right: null"])
@pytest.mark.parametrize("is_first", [True, False])
def test_full_name_goes_before_one_that_is_filled_in(
    folder: Folder, other: str, is_first: bool
) -> None:
    """In whichever order the two stand, as with `each`."""
    lines = [f"  {other}\n", '  "{params.side}": { unit: m }\n']
    folder.write(
        line=head("driver", "line")
        + "params: { side: { default: right } }\n"
        + WIRE
        + "signals:\n"
        + "".join(lines if is_first else lines[::-1])
    )
    profile = folder.check("line").profile
    assert profile is not None
    found = [(name, one.unit, one.max) for name, one in profile.driver.signals.items()]
    assert found == ([("right", "m", 1)] if "max" in other else [])


def test_two_names_that_become_one_are_reported(folder: Folder) -> None:
    """Neither of them is a full name, so neither goes before the other."""
    folder.write(
        line=head("driver", "line")
        + "params: { a: { default: x }, b: { default: x } }\n"
        + WIRE
        + 'signals: { "{params.a}": {}, "{params.b}": {} }\n'
    )
    (problem,) = (one for one in folder.found("line") if one.severity == "error")
    assert (problem.code, problem.path) == ("bad-name", "signals.{params.b}")


def test_two_robots_may_give_one_driver_different_params(folder: Folder) -> None:
    """Nothing of the first is kept for the second."""
    folder.write(
        line=head("driver", "line")
        + "params: { id: {} }\n"
        + WIRE
        + 'commands: { go: { send: "{params.id}" } }\n',
        a=head("robot", "a") + "driver: { use: line.yaml, params: { id: A } }\n",
        b=head("robot", "b") + "driver: { use: line.yaml, params: { id: B } }\n",
    )
    sent = []
    for name in ("a", "b"):
        profile = folder.check(name).profile
        assert profile is not None
        sent.append(profile.driver.commands["go"].send.options)
    assert sent[0] != sent[1]


def test_overrides_change_one_robots_driver(folder: Folder) -> None:
    """Findings in it point at the robot's document."""
    folder.write(
        line=head("driver", "line") + WIRE + "commands: { go: { send: G }, halt: { send: H } }\n",
        bot=head("robot", "bot")
        + "driver:\n  use: line.yaml\n  overrides:\n"
        + "    transports: { wire: { port: 7000 } }\n"
        + '    commands: { go: null, halt: { snd: "X" } }\n',
    )
    (problem,) = folder.found("bot")
    assert (Path(problem.file).name, problem.line, problem.column) == ("bot.yaml", 8, 35)
    assert problem.path == "commands.halt.snd"


# ---- the whole as one document


def test_resolved_document_means_the_same(folder: Folder) -> None:
    """It loads without its parts, and becomes the same driver."""
    folder.write(
        base=head("driver", "base")
        + "params: { id: { type: integer, default: 4 } }\n"
        + "settings: { host: { type: host, default: r } }\n"
        + WIRE.replace("robot", '"{{ settings.host }}"')
        + 'signals:\n  "j_{i}": { each: { i: [1, 2] }, unit: rad }\n'
        + '  b: { type: integer, unit: "%" }\n'
        + "messages:\n  \"j_{i}\": { each: { i: [1, 2] }, regex: '^J{i} (?P<j_{i}>.)$' }\n"
        + "  b: { regex: '^{params.id} (?P<b>[0-9]+)$' }\n"
        + "widgets: { b: { use: value, bind: { value: b } } }\n"
        + 'tests:\n  - { name: "a test: #1", feed: { wire: "J1 5\\n" }, expect: { j_1: 5 } }\n',
        look="urc: 1\nkind: interface\nname: look\ngrid: |\n  b b\n  . .\n",
        bot=head("robot", "bot")
        + "driver: { use: base.yaml, overrides: { signals: { j_2: { title: 'It''s' } } } }\n"
        + "interfaces: { a: look.yaml }\nwidgets: { b: { use: battery, bind: { level: b } } }\n",
    )
    whole = folder.check("bot").profile
    assert whole is not None
    resolved = resolve(str(folder.folder / "bot.yaml"), WidgetFolder(SHELF))
    folder.write(alone__bot=resolved.text)
    again = folder.check("alone/bot")
    assert [one.headline for one in again.problems] == []
    assert again.profile is not None
    assert again.profile.driver.signals == whole.driver.signals
    assert again.profile.driver.transports == whole.driver.transports
    assert again.profile.slots == whole.slots
    assert again.profile.interfaces.keys() == whole.interfaces.keys()
    assert [test.name for test in again.profile.tests] == ["a test: #1"]


def test_resolved_keys_say_where_they_stand(folder: Folder) -> None:
    """The file and line of each, through overrides, extends and each."""
    folder.write(
        base=head("driver", "base")
        + WIRE
        + 'signals:\n  "j_{i}": { each: { i: [1] }, unit: rad }\n',
        line=head("driver", "line") + "extends: base.yaml\nsignals:\n  j_1:\n    max: 3\n",
        bot=head("robot", "bot") + "driver:\n  use: line.yaml\n  overrides:\n"
        "    signals: { j_1: { min: 1 } }\n",
    )
    text = resolve(str(folder.folder / "bot.yaml"), WidgetFolder(SHELF)).text
    found = [line.replace(f"{folder.folder}/", "") for line in text.splitlines()]
    start = found.index("signals:  # bot.yaml:7")
    assert found[start + 1 :] == [
        "  j_1:  # bot.yaml:7",
        "    unit: rad  # base.yaml:7",
        "    max: 3  # line.yaml:7",
        "    min: 1  # bot.yaml:7",
    ]


texts = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20)
anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | texts,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3),
    max_leaves=10,
)


@given(value=anything)
def test_what_is_written_is_read_back(value: object) -> None:
    """Every value of every document, whatever its texts look like."""
    if any(isinstance(one, int) and abs(one) > 10**38 for one in _scalars(value)):
        return  # longer than any number that is read
    assert parse_document(written("key", value), "a.yaml").data == {"key": value}


def _scalars(value: object) -> list[object]:
    if isinstance(value, dict):
        return [one for item in value.values() for one in _scalars(item)]
    if isinstance(value, list):
        return [one for item in value for one in _scalars(item)]
    return [value]


def test_nodes_are_counted_as_the_reader_counts_them() -> None:
    """Keys, values, mappings and lists."""
    assert count_nodes({"a": [1, {"b": None}]}) == 7


def test_document_without_reuse_is_passed_on_as_it_is(folder: Folder) -> None:
    """The usual document pays nothing for what it does not use."""
    folder.write(bot=head("robot", "bot") + WIRE)
    sources = gather(str(folder.folder / "bot.yaml")).sources
    assert sources is not None
    assert sources.root.document.mark.origin is None
    assert sources.root.document.text.startswith("urc: 1")


# ---- roles and tags


def test_a_robot_changes_the_roles_of_its_driver(folder: Folder) -> None:
    """Also the role of a sequence over the command; a stop keeps its role."""
    folder.write(
        line=head("driver", "line")
        + WIRE
        + "commands:\n  tune: { send: TUNE, role: administer }\n  halt: { send: H, stop: true }\n"
        + "sequences: { prepare: [{ run: tune }] }\n",
        bot=head("robot", "bot")
        + "driver: { use: line.yaml, overrides: { commands: { tune: { role: maintain } } } }\n",
        bad=head("robot", "bad")
        + "driver: { use: line.yaml, overrides: { commands: { halt: { role: maintain } } } }\n",
    )
    profile = folder.check("bot").profile
    assert profile is not None
    roles = {name: one.role for name, one in profile.driver.commands.items()}
    assert roles == {"tune": "maintain", "prepare": "maintain", "halt": "drive"}
    (problem,) = folder.found("bad")
    assert (problem.code, Path(problem.file).name) == ("misplaced-key", "bad.yaml")


def test_tags_are_inherited_and_kept_by_resolve(folder: Folder) -> None:
    """A robot without own tags has the tags of the robot that it extends."""
    own = WIRE + "signals: { mode: {} }\nmessages: { m: { regex: '^(?P<mode>.)$' } }\n"
    folder.write(
        base=head("robot", "base") + "tags: [lab, course-2]\n" + own,
        heir=head("robot", "heir") + "extends: base.yaml\n",
        moved=head("robot", "moved") + "extends: base.yaml\ntags: [hall]\n",
        part=head("robot", "part") + "include: [base.yaml]\n",
    )
    found = {}
    for name in ("base", "heir", "moved", "part"):
        profile = folder.check(name).profile
        assert profile is not None
        found[name] = profile.tags
    assert found == {
        "base": ("lab", "course-2"),
        "heir": ("lab", "course-2"),
        "moved": ("hall",),
        "part": (),
    }
    text = resolve(str(folder.folder / "heir.yaml"), WidgetFolder(SHELF)).text
    assert parse_document(text.encode(), "out").data["tags"] == ["lab", "course-2"]  # type: ignore[index,call-overload]

"""Documents that build on others: what comes of them, where findings point, and what is refused."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.config.folder import WIRE, Folder, head
from urc.config.compose.fill import ExpansionBudget, ExpansionTooLarge, fill
from urc.config.compose.merge import Tree, merge
from urc.config.resolve import written
from urc.source import Document, parse_document
from urc.source import Path as Place


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    return Folder(tmp_path)


# ---- merging


def tree(text: str, name: str = "a.yaml") -> Tree:
    document = parse_document(text, name)
    return Tree(document.data, document.mark, document)


@pytest.mark.parametrize(
    ("base", "over", "merged"),
    [
        ("a: {x: 1, y: 2}", "a: {y: 3, z: 4}", {"a": {"x": 1, "y": 3, "z": 4}}),
        ("a: {x: 1, y: 2}", "a: {x: null}", {"a": {"y": 2}}),
        ("a: {x: 1}", "a: {y: null}", {"a": {"x": 1, "y": None}}),
        ("a: 1", "a: {x: 1}", {"a": {"x": 1}}),
        ("a: [1, 2]", "a: [3]", {"a": [3]}),
        (
            "a: [{name: p, x: 1}, {name: q}]",
            "a: [{name: r}, {name: p, y: 2}]",
            {"a": [{"name": "p", "x": 1, "y": 2}, {"name": "q"}, {"name": "r"}]},
        ),
        ("a: [{id: p, x: 1}]", "a: [{id: p, x: 2}]", {"a": [{"id": "p", "x": 2}]}),
        ("a: [{name: p}, {name: q}]", "a: [{name: p, remove: true}]", {"a": [{"name": "q"}]}),
        ("a: [{name: p, x: 1}]", "a: [{x: 2}]", {"a": [{"x": 2}]}),
        ("a: [{name: p}, {name: p}]", "a: [{name: p, x: 1}]", {"a": [{"name": "p", "x": 1}]}),
        (
            "framing: {type: delimiter, tx: LF, rx: LF}",
            "framing: {type: datagram}",
            {"framing": {"type": "datagram"}},
        ),
        (
            "framing: {type: delimiter, tx: LF, rx: LF}",
            "framing: {tx: CR}",
            {"framing": {"type": "delimiter", "tx": "CR", "rx": "LF"}},
        ),
        ("s: {type: integer, min: 1}", "s: {type: number}", {"s": {"type": "number", "min": 1}}),
        (
            "i: {grid: a, title: t}",
            "i: {layouts: {landscape: a}}",
            {"i": {"title": "t", "layouts": {"landscape": "a"}}},
        ),
    ],
)
def test_merge(base: str, over: str, merged: object) -> None:
    """Mappings by key, lists of named things by name, all else replaced; the sources are kept."""
    below, above = tree(base), tree(over, "b.yaml")
    before = parse_document(base, "a.yaml").data, parse_document(over, "b.yaml").data
    assert merge(below, above).value == merged
    assert (below.value, above.value) == before


names = st.sampled_from(["a", "b", "c", "name"])
values = st.recursive(
    st.integers(0, 3) | st.none() | st.sampled_from(["x", "y"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(names, inner, max_size=3),
    max_leaves=12,
)
mappings = st.dictionaries(names, values, min_size=1, max_size=3)


def places(value: object, path: Place = ()) -> list[Place]:
    inside: Any = value.items() if isinstance(value, dict) else ()
    inside = enumerate(value) if isinstance(value, list) else inside
    return [path, *(place for key, item in inside for place in places(item, (*path, key)))]


@given(base=mappings, over=mappings)
def test_every_value_of_a_merged_document_stands_in_one_of_the_two(
    base: dict[str, object], over: dict[str, object]
) -> None:
    """Each place has a mark, what is written there is the value, and once is as good as twice."""
    below = tree("".join(written(key, item) for key, item in base.items()))
    above = tree("".join(written(key, item) for key, item in over.items()), "b.yaml")
    result = merge(below, above)
    home = above.home
    document = Document(home.file, home.text, home.lines, result.value, result.mark)
    for place in places(result.value)[1:]:
        mark = document.at(place)
        assert mark is not None
        value: Any = result.value
        for part in place:
            value = value[part]
        source = document.source_of(place)
        if isinstance(value, (int, str)):
            line = source.lines[mark.span.line - 1]
            assert line[mark.span.column - 1 : mark.span.end_column - 1].strip('"') == str(value)
    if "remove" not in repr(over) and "None" not in repr(over):
        assert merge(result, above).value == result.value


# ---- extends and include


def test_robot_that_extends_another_has_all_of_it(folder: Folder) -> None:
    """Its own name, the base's title and wire, one value changed, one signal gone."""
    folder.write(
        parts__base=head("robot", "base")
        + "title: Base\n"
        + WIRE
        + "signals: { a: {}, b: { max: 1 } }\n"
        + "messages: { all: { regex: '^(?P<a>.) (?P<b>.)$' } }\n",
        bot=head("robot", "bot")
        + "extends: parts/base.yaml\nsignals: { b: null, a: { max: 5 } }\n"
        + "messages: { all: { regex: '^(?P<a>.)$' } }\n",
    )
    profile = folder.check("bot").profile
    assert profile is not None
    assert (profile.name, profile.title) == ("bot", "Base")
    assert list(profile.driver.signals) == ["a"]
    assert profile.driver.signals["a"].max == 5


def test_paths_of_a_base_are_relative_to_the_base(folder: Folder) -> None:
    """The base's driver stands beside the base, wherever the robot is that extends it."""
    folder.write(
        parts__line=head("driver", "line") + WIRE,
        parts__base=head("robot", "base") + "driver: line.yaml\n",
        robots__bot=head("robot", "bot") + "extends: ../parts/base.yaml\n",
    )
    assert {one.code for one in folder.found("robots/bot")} <= {"unused-transport"}


def test_included_documents_may_share_one_that_they_both_include(folder: Folder) -> None:
    """A diamond is no circle, and what both say alike is no clash."""
    part = "urc: 1\nkind: driver\npartial: true\n"
    folder.write(
        low=part + "signals: { a: {} }\n",
        left=part + "include: [low.yaml]\nmessages: { l: { regex: '^L(?P<a>.)$' } }\n",
        right=part + "include: [low.yaml]\nmessages: { r: { regex: '^R(?P<a>.)$' } }\n",
        line=head("driver", "line") + "include: [left.yaml, right.yaml]\n" + WIRE,
    )
    checked = folder.check("line")
    assert checked.problems == ()
    assert checked.profile is not None
    assert set(checked.profile.driver.messages) == {"l", "r"}
    names = [Path(file).name for file in checked.files if file.endswith(".yaml")]
    assert names[:4] == ["line.yaml", "left.yaml", "low.yaml", "right.yaml"]


def test_chain_of_documents_is_bounded(folder: Folder) -> None:
    """Sixteen that build on each other are read, the seventeenth is not."""
    for number in range(1, 19):
        below = f"extends: b{number + 1}.yaml\n" if number < 18 else WIRE
        folder.write(**{f"b{number}": head("driver", f"b{number}") + below})
    assert [one.code for one in folder.found("b3")] == ["unused-transport"]
    problems = folder.found("b1")
    assert [(one.code, Path(one.file).name, one.line) for one in problems] == [
        ("too-many-files", "b16.yaml", 4)
    ]


def test_number_of_documents_is_bounded(folder: Folder) -> None:
    """However they are arranged, 64 are the most."""
    part = "urc: 1\nkind: driver\npartial: true\n"
    for row in range(3):
        includes = ", ".join(f"p{row}_{number}.yaml" for number in range(30))
        folder.write(**{f"row{row}": f"{part}include: [{includes}]\n"})
        folder.write(**{f"p{row}_{number}": part for number in range(30)})
    folder.write(
        line=head("driver", "line") + "include: [row0.yaml, row1.yaml, row2.yaml]\n" + WIRE
    )
    assert "too-many-files" in {one.code for one in folder.found("line")}


def test_wide_diamonds_cost_no_more_than_their_files(folder: Folder) -> None:
    """Each document is put together once: two references at 15 levels are not 32768 readings."""
    part = "urc: 1\nkind: driver\npartial: true\n"
    for level in range(14):
        twice = f"include: [d{level + 1}.yaml, ./d{level + 1}.yaml]\n"
        folder.write(**{f"d{level}": part + twice})
    folder.write(d14=part + "signals: { a: {} }\n")
    folder.write(line=head("driver", "line") + "include: [d0.yaml]\n" + WIRE)
    checked = folder.check("line")
    assert {one.severity for one in checked.problems} == {"warning"}
    assert len({name for name in checked.files if "widget" not in name}) == 16


# ---- each


def test_each_writes_out_keys_texts_and_values(folder: Folder) -> None:
    """Names, patterns, titles; a text that is one name keeps the type of the value."""
    folder.write(
        line=head("driver", "line")
        + WIRE
        + 'signals:\n  "{m.side}_{i}":\n    each: { m: [{ side: left, top: 5 }, { side: right,'
        + ' top: 7 }], i: [1, 2] }\n    max: "{m.top}"\n    title: "{m.side} {i} of {{i}}"\n'
        + 'messages:\n  "{s}": { each: { s: [left_1, left_2, right_1, right_2] },'
        + " regex: '^{s} (?P<{s}>[0-9]{1,3})$' }\n"
    )
    checked = folder.check("line")
    assert checked.problems == ()
    assert checked.profile is not None
    signals = checked.profile.driver.signals
    assert list(signals) == ["left_1", "left_2", "right_1", "right_2"]
    assert [one.max for one in signals.values()] == [5, 5, 7, 7]
    assert signals["right_2"].title == "right 2 of {{i}}"


def test_a_field_of_a_pattern_may_be_a_name_of_each(folder: Folder) -> None:
    """Two braces are a template's, but for the field whose whole name is filled in."""
    folder.write(
        base=head("driver", "base")
        + WIRE
        + """
signals: { "{n}": { each: { n: [tilt, pan] } } }
messages:
  "m_{n}":
    each: { n: [tilt, pan] }
    pattern: "{n} {{n}:number} {{ {_{n}:word}"
""",
    )
    profile = folder.check("base").profile
    assert profile is not None
    fields = [message.read.fields for message in profile.driver.messages.values()]
    assert fields == [("tilt", "_tilt"), ("pan", "_pan")]


def test_one_of_many_is_changed_or_taken_away_by_name(folder: Folder) -> None:
    """In the document itself, or in one that extends it, before or behind the `each`."""
    folder.write(
        base=head("driver", "base")
        + WIRE
        + "signals:\n  j_1: { unit: deg }\n"
        + '  "j_{i}": { each: { i: [1, 2, 3, 4] }, unit: rad, max: 6 }\n  j_2: null\n',
        line=head("driver", "line")
        + "extends: base.yaml\nsignals: { j_4: null, j_3: { max: 1 } }\n",
    )
    profile = folder.check("line").profile
    assert profile is not None
    found = {name: (one.unit, one.max) for name, one in profile.driver.signals.items()}
    assert found == {"j_1": ("deg", 6), "j_3": ("rad", 1)}


def test_polls_tests_and_slots_are_written_out_too(folder: Folder) -> None:
    """Lists repeat the item; a poll without a name is told apart by its place."""
    folder.write(
        bot=head("robot", "bot")
        + WIRE
        + 'signals:\n  "b_{i}": { each: { i: [1, 2] }, type: integer, unit: "%" }\n'
        + 'polls:\n  - each: { i: [1, 2] }\n    every: 1s\n    send: "B{i}?"\n'
        + "    reply: { regex: '^{i} (?P<b_{i}>[0-9]+)$' }\n"
        + 'widgets:\n  "b-{i}": { each: { i: [1, 2] }, use: battery, bind: { level: "b_{i}" } }\n'
        + 'tests:\n  - { each: { i: [1, 2] }, name: "b{i}", reply_to: 0, feed: { wire: "1 7\\n" },'
        + " expect: { b_1: 7 } }\n"
        + "simulator:\n  wire:\n"
        + '    - { each: { i: [1, 2] }, match: "^B{i}\\\\?$", send: "{i} 5" }\n'
    )
    checked = folder.check("bot")
    assert checked.problems == ()
    assert checked.profile is not None
    assert [poll.name for poll in checked.profile.driver.polls] == ["polls.0", "polls.1"]
    assert list(checked.profile.slots) == ["b-1", "b-2"]
    assert [test.name for test in checked.profile.tests] == ["b1", "b2"]
    assert len(checked.profile.simulator) == 2


def test_repeated_text_is_reported_once(folder: Folder) -> None:
    """A hundred copies of one mistake are one mistake."""
    numbers = list(range(100))
    folder.write(
        line=head("driver", "line")
        + WIRE
        + f'signals:\n  "j_{{i}}": {{ each: {{ i: {numbers} }}, unit: 5, precison: 1 }}\n'
    )
    assert [one.code for one in folder.found("line")] == ["wrong-type", "unknown-key"]


@pytest.mark.parametrize(
    ("text", "offset", "written_offset"),
    [("a{i}b", 0, 0), ("a{i}b", 1, 1), ("a{i}b", 3, 1), ("a{i}b", 4, 4), ("{i}{i}x", 6, 6)],
)
def test_character_of_a_filled_in_text_is_found_in_the_written_one(
    text: str, offset: int, written_offset: int
) -> None:
    """`{i}` becomes 123 here, so that all behind it moves."""
    document = parse_document(written("t", text), "a.yaml")
    one = Tree(document.data, document.mark, document)
    filled = fill(one, (), {"i": 123}, ExpansionBudget(100), _Nobody())
    mark = filled.mark.children["t"]
    assert mark.written is not None
    assert mark.written.offset(offset) == written_offset


class _Nobody:
    def unknown(self, path: Place, name: str, word: str, offset: int) -> None:
        raise AssertionError

    def unquoted(self, path: Place, text: str) -> None:
        raise AssertionError


def test_text_that_grows_without_end_is_refused() -> None:
    """A megabyte of names, each of 200 characters."""
    document = parse_document(written("t", "{i}" * 100_000), "a.yaml")
    one = Tree(document.data, document.mark, document)
    with pytest.raises(ExpansionTooLarge):
        fill(one, (), {"i": "x" * 200}, ExpansionBudget(100), _Nobody())

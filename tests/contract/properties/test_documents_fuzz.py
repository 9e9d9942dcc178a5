"""Whatever a file holds, checking it ends in findings: never another exception, never a hang."""

import tempfile
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effort import examples
from urc.config.load import WidgetFolder, check
from urc.problems import ProblemsError, to_json, to_text
from urc.runtime.registries import built_in_catalog
from urc.source import parse_document

ROOT = Path(__file__).resolve().parents[3]
PUPPET = (ROOT / "robots" / "puppet.yaml").read_text("utf-8")
SHELF = WidgetFolder(ROOT / "tests" / "broken" / "shelf")
CATALOG = built_in_catalog()

pieces = st.sampled_from(
    [
        "a", "b: ", "- ", "? ", ": ", ":", "\n", "\n  ", "\n\t", "{", "}", "[", "]", ",", "'", '"',
        "\\", "&x ", "*x", "!t ", "!!str ", "|", ">-", "#", " #c", "%", "@", "`", "---\n", "...\n",
        "<<: *x", "1", "0x1F", ".inf", "~", "é", "\u2028", "\x85", "\r", "\r\n", "{{ x }}",
        "urc: 1\n", "kind: robot\n", "name: p\n", "  ",
    ]
)  # fmt: skip
yamlish = st.lists(pieces, max_size=40).map("".join)

plain = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
words = st.sampled_from(
    ["{{ settings.host }}", "{{", "^(?P<battery>\\d+)$", "(", "wire", "battery", "1s", "0s", "LF",
     "\\n", ".  battery", "a b\nc", "parts/driver.yaml", "value", "level", "9999999h", "", "tcp"]
)  # fmt: skip
values = st.recursive(
    plain | words,
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3)
    ),
    max_leaves=6,
)


@given(st.binary(max_size=300))
@settings(deadline=None)
def test_any_bytes_are_a_document_or_findings(content: bytes) -> None:
    """Every finding has a place and can be told."""
    assert_told(content)


@given(yamlish)
@settings(max_examples=examples(400), deadline=None)
def test_any_yamlish_text_is_a_document_or_findings(text: str) -> None:
    """Made of the signs that mean something, so that the parser gets far."""
    assert_told(text)


def assert_told(content: bytes | str) -> None:
    try:
        problems = parse_document(content, "f.yaml").problems
    except ProblemsError as error:
        problems = error.problems
        assert problems
    for problem in problems:
        assert problem.line >= 1
        assert problem.column >= 1
        assert "\n" not in problem.headline
        assert to_text(problem).startswith("f.yaml:")
        to_json(problem)


def places(value: object, path: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """Return the path of every value."""
    found = [path]
    if isinstance(value, dict):
        for key, item in value.items():
            found += places(item, (*path, key))
    elif isinstance(value, list):
        for place, item in enumerate(value):
            found += places(item, (*path, place))
    return found


def replaced(value: object, path: tuple[str | int, ...], new: object) -> object:
    """Return `value` with `new` at `path`."""
    if not path:
        return new
    head, *rest = path
    if isinstance(value, dict):
        return {key: replaced(item, tuple(rest), new) if key == head else item
                for key, item in value.items()}  # fmt: skip
    assert isinstance(value, list)
    return [replaced(item, tuple(rest), new) if place == head else item
            for place, item in enumerate(value)]  # fmt: skip


DATA = parse_document(PUPPET, "puppet.yaml").data
PLACES = places(DATA)


def flow(value: object) -> str:
    """Return a value as YAML in flow style."""
    if isinstance(value, dict):
        return (
            "{" + ", ".join(f"{flow(str(key))}: {flow(item)}" for key, item in value.items()) + "}"
        )
    if isinstance(value, list):
        return "[" + ", ".join(map(flow, value)) + "]"
    if isinstance(value, str):
        escaped = "".join(char if char.isalnum() else f"\\U{ord(char):08x}" for char in value)
        return f'"{escaped}"'
    if isinstance(value, float):
        return str(value).replace("inf", ".inf").replace("nan", ".nan")
    return {None: "~", True: "true", False: "false"}.get(value, str(value))  # type: ignore[call-overload]


@given(st.sampled_from(PLACES), values)
@settings(max_examples=examples(300), deadline=None)
def test_any_change_of_a_good_document_is_told(path: tuple[str | int, ...], value: object) -> None:
    """All passes meet values that their authors did not think of."""
    text = flow(replaced(DATA, path, value))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "changed.yaml")
        file.write_text(text, "utf-8")
        checked = check(file, CATALOG, SHELF)
    assert (checked.profile is None) == any(one.severity == "error" for one in checked.problems)
    for problem in checked.problems:
        to_text(problem)

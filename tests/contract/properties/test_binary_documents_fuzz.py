"""Whatever stands in a document about binary frames, checking it ends in findings."""

import tempfile
from contextlib import suppress
from pathlib import Path

import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effort import examples
from urc.config.load import WidgetFolder, check
from urc.expressions import ExpressionError
from urc.model.driver import Driver
from urc.problems import to_text
from urc.protocol.forms.table import build_reader, build_writer
from urc.protocol.values.payload import BadText, CodecContext, Frame, NotWritable
from urc.runtime.registries import built_in_catalog

ROOT = Path(__file__).resolve().parents[3]
DATA = yaml.safe_load((ROOT / "tests/contract/every_key/binary.yaml").read_text("utf-8"))
SHELF = WidgetFolder(ROOT / "tests" / "broken" / "shelf")
CATALOG = built_in_catalog()

words = st.sampled_from(
    ["u8", "u16", "u16be x", "i24le", "f32be", "bits", "text", "bytes", "vector", "vector v",
     "rest", "NUL", "_left", "_size - 1", "speed", "{{ x }}", "{{ speed | u8 }}", "0x10", "", " ",
     "u8 1", "status", "a b c", "1", "-1", "u8 -1", "(", "settings.x", "mode"]
)  # fmt: skip
plain = st.none() | st.booleans() | st.integers(-(2**65), 2**65) | st.floats() | words
item = st.dictionaries(
    st.sampled_from(
        ["id", "type", "size", "count", "if", "enum", "const", "valid", "bits", "order", "scale",
         "offset", "encoding", "pad", "until", "trim", "value", "switch", "by", "cases", "else",
         "width", "signed", "min", "max", "1", "x"]
    ),
    plain,
    max_size=4,
)  # fmt: skip
values = st.recursive(
    plain | item,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(words, inner),
    max_leaves=5,
)


def places(value: object, path: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """Return the path of every value below the parts that this test is about."""
    found = [path]
    if isinstance(value, dict):
        for key, inner in value.items():
            found += places(inner, (*path, key))
    elif isinstance(value, list):
        for place, inner in enumerate(value):
            found += places(inner, (*path, place))
    return found


def replaced(value: object, path: tuple[str | int, ...], new: object) -> object:
    """Return `value` with `new` at `path`."""
    if not path:
        return new
    head, *rest = path
    if isinstance(value, dict):
        return {
            key: replaced(inner, tuple(rest), new) if key == head else inner
            for key, inner in value.items()
        }
    assert isinstance(value, list)
    return [
        replaced(inner, tuple(rest), new) if place == head else inner
        for place, inner in enumerate(value)
    ]


PLACES = [
    one
    for one in places(DATA)
    if one[:1] in (("types",), ("enums",), ("messages",), ("commands",)) and len(one) > 1
]


@given(st.sampled_from(PLACES), values)
@settings(max_examples=examples(300), deadline=None)
def test_any_change_of_a_good_document_is_told(path: tuple[str | int, ...], value: object) -> None:
    """Never another exception, and always a place."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "binary.yaml")
        file.write_text(yaml.safe_dump(replaced(DATA, path, value), allow_unicode=True), "utf-8")
        checked = check(file, CATALOG, SHELF)
    assert (checked.profile is None) == any(one.severity == "error" for one in checked.problems)
    for problem in checked.problems:
        assert problem.line >= 1
        to_text(problem)
    if checked.profile is not None:
        assert_works(checked.profile.driver)


def assert_works(driver: Driver) -> None:
    """What was found good can be built and used, on bytes and values that it does not expect."""
    context = CodecContext("latin-1")
    for message in driver.messages.values():
        for data in (b"", bytes(range(64)), b"\x04\x02\xfa" + b"\xff" * 300):
            with suppress(BadText):
                build_reader(message.read, context).read(Frame(data, "latin-1"))
        with suppress(NotWritable):
            build_reader(message.read, context).write({"speed": 1, "mode": "idle", "_cells": 9})
    for command in driver.commands.values():
        for speed in (5, -1.5, "x", None):
            with suppress(NotWritable, ExpressionError):
                build_writer(command.send, context).write({"speed": speed, "settings": {}})

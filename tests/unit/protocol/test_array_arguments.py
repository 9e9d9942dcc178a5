"""Arguments of many values: typed, bounded, and written by every form that writes."""

import pytest

from tests.dialogue import Dialogue, driver_of
from urc.cli.error_report import Misuse
from urc.cli.send import _arguments
from urc.model.driver import Command
from urc.protocol.requests.encode import BadArgument, check_arguments
from urc.simulator.reply_echo import typed_arguments

ARM = """
commands:
  text:
    send: "MOVE {{ joints | join(',') }};"
    args: { joints: { type: array, items: number, size: 3, min: -3, max: 3 } }
  json:
    send: { json: { go: "{{ joints }}", speed: "{{ speed }}" } }
    args: { joints: { type: array, items: integer }, speed: { default: 1 } }
  binary:
    send: { struct: [{ id: joints, type: i8, count: 3 }] }
    args: { joints: { type: array, items: integer, size: 3, default: [1, -2, 3] } }
  counted:
    send: { struct: [{ id: names, type: text, size: u8, count: u8 }] }
    args: { names: { type: array, items: string, choices: [a, b] } }
"""


def command(name: str) -> Command:
    return driver_of(ARM).commands[name]


@pytest.mark.parametrize(
    ("name", "given", "sent"),
    [
        ("text", {"joints": (1, -0.5, 3)}, "MOVE 1,-0.5,3;"),
        ("json", {"joints": [4, 5]}, '{"go":[4,5],"speed":1}'),
        ("json", {"joints": []}, '{"go":[],"speed":1}'),
        ("binary", {}, "\x01\xfe\x03"),
        ("counted", {"names": ["a", "b", "a"]}, "\x03\x01a\x01b\x01a"),
    ],
)
def test_an_array_is_written(name: str, given: dict[str, object], sent: str) -> None:
    """In text by the filter `join`, in JSON as a list, in a struct by `count`."""
    talk = Dialogue(ARM).connect()
    talk.run(name, **given)  # type: ignore[arg-type]
    assert (talk.sent, talk.messages) == ([sent], [])


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("text", [1, 2], "joints: expected 3 elements, found 2"),
        ("text", 1, "joints: expected a list, found 1"),
        ("text", "123", "joints: expected a list"),
        ("text", [1, 2, 4], r"joints\[2\]: 4 is above its maximum 3"),
        ("text", [1, "2", 3], r"joints\[1\]: expected number, found '2'"),
        ("text", [1, [2], 3], r"joints\[1\]: expected number"),
        ("text", [1, float("nan"), 3], r"joints\[1\]: expected number"),
        ("json", [1.5], r"joints\[0\]: expected integer"),
        ("json", [0] * 1025, "joints: expected at most 1024 elements"),
        ("counted", ["c"], r"names\[0\]: 'c' is not one of 'a', 'b'"),
    ],
)
def test_an_array_that_is_no_good_is_refused(name: str, value: object, words: str) -> None:
    """By the place of the element."""
    one = command(name)
    with pytest.raises(BadArgument, match=words):
        check_arguments(one, {next(iter(one.arguments)): value})


def test_the_emulated_robot_reads_arrays_back() -> None:
    """Out of text they come as one text, and get their elements back."""
    one = command("text")
    assert typed_arguments({"joints": "1,2.5,3"}, one.arguments) == {"joints": (1.0, 2.5, 3.0)}
    assert typed_arguments({"joints": "1,2"}, one.arguments) is None


@pytest.mark.parametrize(
    ("name", "word", "values"),
    [
        ("text", "joints=1,2.5,-3", {"joints": (1, 2.5, -3)}),
        ("json", "joints=", {"joints": ()}),
        ("json", "joints=[1, 0x]", "is not a JSON array"),
        ("json", "joints=[1, 2]", {"joints": (1, 2)}),
        ("json", "joints=1,a", "expected integer, found 'a'"),
    ],
)
def test_an_array_is_typed_with_commas_or_as_json(name: str, word: str, values: object) -> None:
    """`urc send robot move joints=1,2,3`."""
    if isinstance(values, str):
        with pytest.raises(Misuse, match=values):
            _arguments(command(name), [word])
    else:
        assert _arguments(command(name), [word]) == values

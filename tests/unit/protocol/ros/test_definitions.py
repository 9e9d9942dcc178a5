"""Definitions of ROS types, in the texts of ``.msg`` and ``.idl`` files."""

import struct
from typing import Any

import pytest
from rosbags.typesys import get_types_from_idl, get_types_from_msg

from urc.protocol.ros.common_types import common_types
from urc.protocol.ros.definition import BadDefinition, Definitions, MessageField, layout_of
from urc.protocol.ros.idl_text import parse_idl
from urc.protocol.ros.msg_text import parse_msg
from urc.protocol.ros.read_source import BadRosMessage, build_read, read_safely
from urc.protocol.ros.wanted import ALL, wanted_of
from urc.protocol.ros.write_source import Unwritable, Writer

MSG = """\
# All that a definition may contain.
int32 ONE=1
int32 MINUS = -0x10
float64 HALF=0.5  # a half
string NAME=two words # and no comment
string<=5 short "hi"   # with a bound
bool flag true
float32[3] fixed [1.0, 2, 3]
int8[<=4] few
uint8[] bytes
Point[] points
other_pkg/Thing thing
wstring wide
char letter 65
================================================================================
MSG: pkg/Point
float64 x 1.5
float64 y
================================================================================
MSG: other_pkg/Thing
string name 'it has a # sign'
"""

IDL = """\
// generated from rosidl_adapter/resource/msg.idl.em
#include "builtin_interfaces/msg/Time.idl"
module pkg {
  module msg {
    typedef double double__36[36];
    typedef string<8> label;
    module Robot_Constants {
      const int32 ON = 1;
      @verbatim (language="comment", text="a } brace; and" "two texts")
      const string WORD = "x;y";
    };
    enum Mode { IDLE, BUSY };
    @verbatim (language="comment", text=
      "A robot.")
    struct Robot {
      /* several
         lines */
      builtin_interfaces::msg::Time stamp;
      @unit (value="m") @default (value=1.5)
      double x;
      double__36 covariance;
      sequence<pkg::msg::Part> parts;
      sequence<uint8, 16> few;
      sequence<string> names;
      unsigned long long big;
      long long left, right;
      boolean on;
      octet raw[4];
      wstring wide;
      label text;
      Mode mode;
    };
  };
};
================================================================================
IDL: pkg/msg/Part
module pkg { module msg { struct Part { float mass; string name; }; }; };
"""


def fields(definitions: Definitions, name: str) -> dict[str, MessageField]:
    return {one.name: one for one in definitions[name].fields}


def test_a_msg_text_has_fields_constants_and_defaults() -> None:
    found = parse_msg("pkg/msg/All", MSG)
    assert found["pkg/All"].constants == {
        "ONE": 1,
        "MINUS": -16,
        "HALF": 0.5,
        "NAME": "two words # and no comment",
    }
    assert fields(found, "pkg/All") == {
        "short": MessageField("short", "string", default="hi"),
        "flag": MessageField("flag", "bool", default=True),
        "fixed": MessageField("fixed", "float32", 3, [1.0, 2.0, 3.0]),
        "few": MessageField("few", "int8", 0, bound=4),
        "bytes": MessageField("bytes", "uint8", 0),
        "points": MessageField("points", "Point", 0),
        "thing": MessageField("thing", "other_pkg/Thing"),
        "wide": MessageField("wide", "wstring"),
        "letter": MessageField("letter", "char", default=65),
    }
    assert fields(found, "other_pkg/Thing")["name"].default == "it has a # sign"


def test_a_message_without_values_has_the_defaults() -> None:
    layout = layout_of("pkg/All", parse_msg("pkg/All", MSG))
    read = read_safely(build_read(layout, ALL), Writer(layout).write({"points": [{}]}).data)
    assert read == {
        "short": "hi",
        "flag": True,
        "fixed": [1.0, 2.0, 3.0],
        "few": [],
        "bytes": b"",
        "points": [{"x": 1.5, "y": 0.0}],
        "thing": {"name": "it has a # sign"},
        "wide": "",
        "letter": 65,
    }


def test_the_fields_of_both_texts_are_those_of_rosbags() -> None:
    theirs = get_types_from_msg(MSG.replace("two words # and no comment", "two"), "pkg/msg/All")
    assert [name for name, _ in theirs["pkg/msg/All"][1]] == list(
        fields(parse_msg("pkg/All", MSG), "pkg/All")
    )
    plain = (
        IDL.partition("====")[0].replace("enum Mode { IDLE, BUSY };", "").replace("Mode", "long")
    )
    plain = plain.replace('#include "builtin_interfaces/msg/Time.idl"', "")
    plain = plain.replace("label text", "string text").replace("typedef string<8> label;", "")
    found: Any = get_types_from_idl(plain)
    described = dict(found["pkg/msg/Robot"][1])
    ours = fields(parse_idl("pkg/msg/Robot", IDL), "pkg/Robot")
    assert list(described) == list(ours)
    assert described["covariance"][1][1] == ours["covariance"].length == 36
    assert described["raw"][1][1] == ours["raw"].length == 4


def test_an_idl_text_gives_the_same_bytes_as_the_msg_text_of_the_type() -> None:
    found = parse_idl("pkg/msg/Robot", IDL)
    assert fields(found, "pkg/Robot")["x"].default == 1.5
    assert fields(found, "pkg/Robot")["few"] == MessageField("few", "uint8", 0, bound=16)
    same = """\
builtin_interfaces/Time stamp
float64 x 1.5
float64[36] covariance
Part[] parts
uint8[<=16] few
string[] names
uint64 big
int64 left
int64 right
bool on
octet[4] raw
wstring wide
string<=8 text
uint32 mode
===
MSG: pkg/Part
float32 mass
string name
"""
    message = {"parts": [{"mass": 2, "name": "arm"}], "wide": "漢", "left": -1, "few": b"ab"}
    by_idl, by_msg = (
        Writer(layout_of("pkg/Robot", one)).write(message).data
        for one in (found, parse_msg("pkg/Robot", same.replace("===", "=" * 80)))
    )
    assert by_idl == by_msg


def test_wide_strings_have_four_bytes_for_each_unit_of_utf_16() -> None:
    """rosidl_typesupport_fastrtps_cpp writes a count, and a uint32 for each unit."""
    layout = layout_of("pkg/W", parse_msg("pkg/W", "wstring text\nuint16 after"))
    data = bytes.fromhex("00010000 03000000 61000000 3dd80000 00de0000 0700")
    assert read_safely(build_read(layout, ALL), data) == {"text": "a😀", "after": 7}
    assert Writer(layout).write({"text": "a😀", "after": 7}).data == data


def test_a_time_of_now_is_left_to_the_sender() -> None:
    layout = layout_of("pkg/S", parse_msg("pkg/S", "string a\nbuiltin_interfaces/Time stamp"))
    written = Writer(layout).write({"a": "x", "stamp": "now"})
    assert written.stamps == (12,)
    assert written.data[12:] == bytes(8)


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        ({"linear": {"x": "fast"}}, "linear.x: 'fast' is not a number"),
        ({"linaer": {}}, "the message has no 'linaer'; it has: linear, angular"),
        ({"linear": {"w": 1}}, "linear has no 'w'; it has: x, y, z"),
        ({"linear": 5}, "linear: 5 is not a mapping of fields"),
        ([], "the message: [] is not a mapping of fields"),
    ],
)
def test_a_message_that_does_not_fit_names_its_field(message: object, reason: str) -> None:
    writer = Writer(layout_of("geometry_msgs/Twist", common_types()))
    with pytest.raises(Unwritable) as problem:
        writer.write(message)
    assert str(problem.value) == reason


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("float64", "pkg/T: 'float64' is not a field"),
        ("int32 x one", "pkg/T: 'one' is not a valid int32"),
        ("int32 x\nint32 x", "pkg/T has two fields named x"),
        ("int32[9999999] x", "pkg/T: the array x has 9999999 elements"),
        ("x" * 300_000, "the definition of pkg/T has more than 262144 characters"),
        ("Missing x", "the type Missing has no definition"),
        ("T inner", "pkg/T is nested more than 24 levels deep"),
    ],
)
def test_a_bad_definition_says_why(text: str, reason: str) -> None:
    with pytest.raises(BadDefinition) as problem:
        layout_of("pkg/T", parse_msg("pkg/T", text))
    assert str(problem.value) == reason


@pytest.mark.parametrize(
    "text",
    [
        "module a { struct T { long x; }",
        "/*" * 100_000,
        "module a {" * 100,
        'struct T { @default (value="x long y; };',
        "struct T { sequence<sequence<long>> x; };",
        "struct T : Base { long x; };",
        "struct T { long x[0]; };",
        "struct T { long x",
        "\0",
    ],
)
def test_a_bad_idl_text_is_refused(text: str) -> None:
    with pytest.raises(BadDefinition):
        parse_idl("pkg/msg/T", text)


def test_types_that_grow_exponentially_are_refused() -> None:
    levels = "".join(
        f"{'=' * 80}\nMSG: pkg/L{n}\nL{n + 1}[9] a\nL{n + 1} b\nL{n + 1} c\n" for n in range(20)
    )
    text = f"L0 x\n{levels}{'=' * 80}\nMSG: pkg/L20\nint8 x"
    with pytest.raises(BadDefinition) as problem:
        layout_of("pkg/T", parse_msg("pkg/T", text))
    assert str(problem.value) == "a message has more than 8192 fields"


def test_deeply_nested_sequences_are_refused_in_words() -> None:
    """Python itself limits how deep loops nest."""
    levels = "".join(f"{'=' * 80}\nMSG: pkg/L{n}\nL{n + 1}[] a\nstring b\n" for n in range(23))
    text = f"L0 x\n{levels}{'=' * 80}\nMSG: pkg/L23\nint8 x"
    layout = layout_of("pkg/T", parse_msg("pkg/T", text))
    with pytest.raises(BadDefinition, match="nested too deeply"):
        build_read(layout, ALL)


STRINGS = layout_of("pkg/T", parse_msg("pkg/T", "string[] names\nfloat64[] values\nstring last"))


@pytest.mark.parametrize("wanted", [ALL, wanted_of([("last",)]), wanted_of([("values",)])])
def test_lengths_that_lie_are_faults(wanted: Any) -> None:
    read = build_read(STRINGS, wanted)
    good = Writer(STRINGS).write({"names": ["a", "bc"], "values": [1.5, 2], "last": "x"}).data
    assert read_safely(read, good)
    for place in range(4, len(good) - 4, 4):
        for length in (0xFFFFFFFF, 0x7FFFFFFF, 1_000_000):
            data = good[:place] + struct.pack("<I", length) + good[place + 4 :]
            try:
                read_safely(read, data)
            except BadRosMessage:
                continue
    for end in range(4, len(good)):
        with pytest.raises(BadRosMessage):
            read_safely(build_read(STRINGS, ALL), good[:end])


def test_many_empty_texts_are_refused_before_they_fill_the_memory() -> None:
    count = 300_000
    data = b"\0\1\0\0" + struct.pack("<I", count) + struct.pack("<IB3x", 1, 0) * count + bytes(16)
    with pytest.raises(BadRosMessage) as problem:
        read_safely(build_read(STRINGS, ALL), data)
    assert str(problem.value) == "the arrays have too many elements"

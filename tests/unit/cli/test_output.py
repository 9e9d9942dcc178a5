"""What is printed of a robot's words cannot act on a terminal, nor fake a line."""

import json
import sys
from unittest.mock import patch

import pytest

from urc.cli.output import json_text
from urc.problems import printable

WILD = {
    "start of a control sequence, C1": "\x9b31m",
    "start of a title, C1": "\x9d0;root\x9c",
    "escape": "\x1b[2J",
    "delete": "\x7f",
    "next line": "\x85",
    "line separator": "\u2028",
    "paragraph separator": "\u2029",
    "right to left": "\u202e",
    "isolate": "\u2066\u2069",
    "marks": "\u200e\u200f\u061c",
    "half of a pair": "\udc80",
}


class Utf8:
    """A stream that takes every letter."""

    encoding = "utf-8"


@pytest.mark.parametrize("text", WILD.values(), ids=WILD)
def test_json_escapes_what_acts_on_a_terminal(text: str) -> None:
    """And a reader gets the same text back."""
    with patch.object(sys, "stdout", Utf8()):
        line = json_text({"value": f"é {text} ☃", text: 1})
    assert line.isprintable()
    assert "é " in line
    assert json.loads(line) == {"value": f"é {text} ☃", text: 1}
    line.encode("utf-8")


@pytest.mark.parametrize("text", WILD.values(), ids=WILD)
def test_lines_for_people_escape_it_as_well(text: str) -> None:
    """With what stands for it in its place."""
    line = printable(f"warning: {text}")
    assert line.isprintable()

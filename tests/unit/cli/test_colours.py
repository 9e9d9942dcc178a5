"""Colours: never against NO_COLOR, never in pipes, and never the only carrier of a meaning."""

import io
import re
import sys

import pytest

from urc.cli.colours import coloured_problem, has_colours, painted
from urc.problems import Problem, to_text

PROBLEM = Problem(
    *("unknown-key", "'ever' is not a key of a poll", "a.yaml", 3, 5),
    end_column=9, hint="use the key 'every'", source="  - ever: 1s",
)  # fmt: skip


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return super().isatty() or True  # raises if the stream is closed


@pytest.mark.parametrize(
    ("stream", "environment", "coloured"),
    [
        (Terminal(), {}, True),
        (Terminal(), {"NO_COLOR": ""}, True),  # https://no-color.org: "not an empty string"
        (Terminal(), {"NO_COLOR": "1"}, False),
        (Terminal(), {"NO_COLOR": "0"}, False),
        (Terminal(), {"TERM": "dumb"}, False),
        (io.StringIO(), {}, False),
        (io.StringIO(), {"FORCE_COLOR": "1"}, True),
        (io.StringIO(), {"FORCE_COLOR": "1", "NO_COLOR": "1"}, False),
    ],
)
def test_colours_follow_the_terminal_and_the_user(
    stream: io.StringIO, environment: dict[str, str], coloured: bool
) -> None:
    assert has_colours(stream, environment) is coloured


def test_closed_stream_has_no_colours() -> None:
    stream = Terminal()
    stream.close()
    assert not has_colours(stream, {})


@pytest.mark.parametrize("severity", ["error", "warning"])
def test_coloured_problem_has_the_same_text(severity: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without its control sequences, the text is what pipes get."""
    problem = PROBLEM._replace(severity=severity)  # type: ignore[arg-type]  # of the parametrization
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stdout", Terminal())
    text = coloured_problem(problem)
    assert re.sub(r"\x1b\[[0-9;]*m", "", text) == to_text(problem)
    headline, _, caret, hint = text.splitlines()
    code = "1;31" if severity == "error" else "33"
    assert f" \x1b[{code}m{severity} unknown-key\x1b[0m:" in headline
    assert caret.endswith(f"\x1b[{code}m^^^^\x1b[0m")
    assert hint.startswith("\x1b[32m")
    monkeypatch.setenv("NO_COLOR", "1")
    assert coloured_problem(problem) == to_text(problem)


def test_nothing_is_painted_as_nothing() -> None:
    assert painted("", "bad", Terminal()) == ""

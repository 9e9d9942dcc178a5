"""The status line of long work: on terminals only, and gone at the end."""

import io
import sys
import threading

import pytest

from urc.cli import progress as module
from urc.cli.progress import Progress


class Terminal(io.StringIO):
    """A stream that says it is a terminal, and tells when a line was shown."""

    def __init__(self) -> None:
        super().__init__()
        self.shown = threading.Event()

    def isatty(self) -> bool:
        return True

    def flush(self) -> None:
        self.shown.set()


def test_line_says_what_happens() -> None:
    work = Progress("loading robots", 18)
    work.step("absolem")
    work.step("create-2\x1b[2J")
    assert work.line() == "loading robots · 2 of 18 · create-2\\x1b[2J"
    work = Progress("reading repositories")
    work._start_s -= 61.4
    assert work.line() == "reading repositories · 61 s"
    work.step("x" * 200)
    assert len(work.line()) == 78


def test_status_line_is_erased_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_FIRST_S", 0.0)
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with Progress("loading robots", 2) as work:
        work.step("puppet")
        assert terminal.shown.wait(30)
    text = terminal.getvalue()
    assert "\r\x1b[Kloading robots" in text
    assert text.endswith("\r\x1b[K")


def test_pipes_get_no_status_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_FIRST_S", 0.0)
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    with Progress("loading robots") as work:
        assert work._thread is None
    assert stream.getvalue() == ""

"""What `urc simulate` tells of frames that its robot cannot answer, and of missing packages."""

import logging
from pathlib import Path

import pytest

from urc.cli.rendering import warn_without_encoder
from urc.cli.simulate import UnansweredLog
from urc.config.load import load_profile
from urc.runtime.registries import built_in_catalog
from urc.simulator.servers import camera

ROBOTS = Path(__file__).parents[3] / "robots"


class Teller:
    """Complaints with a clock that is turned by hand, and what they said."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.now = 0.0
        self.complaints = UnansweredLog(self.lines.append, lambda: self.now)

    def hear(self, text: str, times: int = 1) -> list[str]:
        """Let something be complained of; return what is told."""
        for _ in range(times):
            record = logging.LogRecord("x", logging.INFO, "", 0, "%s: %s", ("wire", text), None)
            self.complaints.handle(record)
        return self.said()

    def said(self) -> list[str]:
        told, self.lines[:] = list(self.lines), []
        return told


def test_a_complaint_is_told_once_and_then_counted() -> None:
    """The first at once; the others with their number, not before ten seconds are over."""
    teller = Teller()
    assert teller.hear("no rule matches 'x'") == ["wire: no rule matches 'x'"]
    assert teller.hear("no rule matches 'x'", 41) == []
    teller.now = 10.0
    assert teller.hear("no rule matches 'x'") == ["wire: no rule matches 'x' (42 times)"]
    assert teller.hear("no rule matches 'x'", 2) == []
    teller.complaints.finish()
    assert teller.said() == ["wire: no rule matches 'x' (2 more times)"]


def test_a_flood_of_different_ones_is_told_at_a_measured_pace() -> None:
    """Five lines a second; the rest comes at the end, and none is lost without a word."""
    teller = Teller()
    told = [line for place in range(20) for line in teller.hear(f"odd {place}")]
    assert told == [f"wire: odd {place}" for place in range(5)]
    teller.now = 1.0
    assert teller.hear("odd 7") == ["wire: odd 7 (2 times)"]
    teller.complaints.finish()
    rest = [place for place in range(5, 20) if place != 7]
    assert teller.said() == [
        *(f"wire: odd {place} (1 time)" for place in rest[:10]),
        "other frames without a reply: 4",
    ]


def test_what_is_kept_does_not_grow() -> None:
    """A client that says something else every time costs a bounded number of lines and bytes."""
    teller = Teller()
    told = [line for place in range(1000) for line in teller.hear(f"odd {place}")]
    assert len(told) == 5
    teller.complaints.finish()
    *lines, last = teller.said()
    assert len(lines) == 10
    assert last == "other frames without a reply: 985"


def test_a_robot_without_an_encoder_for_its_video_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In one line with the command; a robot without such a camera is not."""
    tello, puppet = (
        load_profile(str(ROBOTS / f"{name}.yaml"), built_in_catalog())
        for name in ("tello", "puppet")
    )
    warn_without_encoder(tello)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(camera, "has_encoder", lambda: False)
    warn_without_encoder(puppet)
    warn_without_encoder(tello)
    said = capsys.readouterr().err
    assert said.startswith("urc: the emulated tello sends no video, which requires av; to install")
    assert "install 'av" in said
    assert said.count("\n") == 1

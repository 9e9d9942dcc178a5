"""README.md: what a visitor sees in the first minute is there, small, and true."""

from pathlib import Path

import pytest
import yaml

from tests.documentation import ROOT, Block, blocks

README = ROOT / "README.md"
MOST_LINES = 30
MOST_BYTES = 2_000_000


@pytest.fixture
def example() -> Block:
    """The only document of the page."""
    [found] = [one for one in blocks(README) if one.language == "yaml"]
    return found


def test_the_example_moves_in_few_lines(example: Block) -> None:
    """With a stick that stops, in at most 30 lines."""
    assert example.text.count("\n") <= MOST_LINES
    document = yaml.safe_load(example.text)
    held = [one for one in document["commands"].values() if "hold" in one]
    uses = [one["use"] for one in document["widgets"].values()]
    assert held
    assert "joystick" in uses


def test_the_front_page_shows_the_same_robot(example: Block) -> None:
    """Two places that differ would puzzle a reader."""
    assert example.text in (ROOT / "docs/index.md").read_text("utf-8")


def test_the_picture_moves_and_is_small() -> None:
    """An animated WebP of at most 2 MB."""
    picture = Path(ROOT / "docs/_static/drive.webp")
    data = picture.read_bytes()
    assert f"({picture.relative_to(ROOT)})" in README.read_text("utf-8")
    assert len(data) <= MOST_BYTES
    assert data[:4] == b"RIFF"
    assert b"ANIM" in data[:64]

"""What docs/motion-promises.md names as the place and the proof of a promise is there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "motion-promises.md").read_text("utf-8")
PLACES = sorted(set(re.findall(r"`((?:urc|bench|tests)/[^`:]+)(?:::\w+)?`", PAGE)))
TESTS = sorted(set(re.findall(r"`(tests/[^`:]+\.py)::(\w+)`", PAGE)))


def test_there_is_something_to_look_at() -> None:
    assert len(PLACES) > 20
    assert len(TESTS) > 20


@pytest.mark.parametrize("place", PLACES)
def test_a_place_that_is_named_is_there(place: str) -> None:
    assert (ROOT / place).exists()


@pytest.mark.parametrize(("file", "name"), TESTS)
def test_a_test_that_is_named_is_there(file: str, name: str) -> None:
    assert re.search(rf"^(?:async )?def {name}\(", (ROOT / file).read_text("utf-8"), re.MULTILINE)

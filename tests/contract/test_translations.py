"""The catalogues say all that the pages say, and what they say keeps its names."""

import pytest

from scripts import translations


def test_catalogues_are_up_to_date_and_whole(capsys: pytest.CaptureFixture[str]) -> None:
    """Run `python -m scripts.translations`, fill in what is empty, and run it once more."""
    is_wrong = translations.main(["--check"])
    assert not is_wrong, capsys.readouterr().out


def test_the_sources_are_found() -> None:
    found = translations.messages()
    assert "Connect" in found
    assert any(place.endswith(".js") for places in found.values() for place in places)

"""The names on the handle of a drawer."""

import pytest

from urc.web.show.pages import first_names


@pytest.mark.parametrize(
    ("names", "text"),
    [
        ((), ""),
        (("Light",), "Light"),
        (("Speed", "Transforms"), "Speed, Transforms"),
        (("Program", "Loaded", "Temperatures"), "Program, Loaded …"),
        (("Front left flipper", "Front right flipper", "Brake"), "Front left flipper …"),
        (("The name of a very long control", "Lamp"), "The name of a very long control …"),
    ],
)
def test_the_handle_names_the_first_widgets_and_says_that_there_are_more(
    names: tuple[str, ...], text: str
) -> None:
    assert first_names(names) == text

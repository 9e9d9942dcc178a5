"""Lines of lower floors, said in the reader's language."""

from urc._translatable import joined, phrase
from urc.web.words import language, spoken


def test_a_phrase_is_its_english_text_and_is_said_in_others() -> None:
    """With what stands in it; what is no phrase stays."""
    inner = joined(", ", [phrase("always {value}", value=7), "x"])
    line = phrase("connects by {type} ({name}): {options}", type="tcp", name="wire", options=inner)
    assert line == "connects by tcp (wire): always 7, x"
    assert spoken(line) == line
    token = language.set("de")
    try:
        assert spoken(line) == "verbindet sich über tcp (wire): immer 7, x"
        assert spoken("always 7") == "always 7"
    finally:
        language.reset(token)


def test_braces_of_a_document_are_no_holes() -> None:
    """A setting's template goes through as it is written."""
    line = phrase("from the settings: {text}", text="{{ settings.host }}")
    assert line == "from the settings: {{ settings.host }}"
    token = language.set("fr")
    try:
        assert spoken(line) == "des réglages : {{ settings.host }}"
    finally:
        language.reset(token)

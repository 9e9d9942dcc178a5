"""The reference of the language is what the schemas say, and leaves no key out."""

import re

import pytest

from scripts.docs import ROOT, faults_of
from scripts.reference import FOLDER, KINDS, missing, page, read_schema


@pytest.mark.parametrize("kind", KINDS)
def test_page_is_what_the_schema_says(kind: str) -> None:
    """A schema that was changed needs `python -m scripts.reference`."""
    assert (FOLDER / f"{kind}.md").read_text("utf-8") == page(kind)


def test_every_property_has_a_description_and_an_example() -> None:
    """An option without its text or example has no page worth the name."""
    assert missing() == []


@pytest.mark.parametrize("kind", KINDS)
def test_every_property_of_every_definition_has_its_section(kind: str) -> None:
    """Counted in the schema itself, so that the writer cannot pass one over."""
    schema = read_schema(f"{kind}.schema.json")
    wanted = [f"{kind}.{name}" for name in schema["properties"]]
    for definition, inner in schema.get("$defs", {}).items():
        wanted += [definition, *(f"{definition}.{name}" for name in inner.get("properties", {}))]
    headings = re.findall(r"^##+ (.+)$", page(kind), re.MULTILINE)
    assert sorted(headings) == sorted(wanted)


@pytest.mark.parametrize("kind", KINDS)
def test_every_link_of_a_page_leads_somewhere(kind: str) -> None:
    """Types are links to where they are described, on this page or another one."""
    assert list(faults_of(ROOT / "docs" / "reference" / f"{kind}.md")) == []

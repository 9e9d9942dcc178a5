"""The reference is what the code and the schemas say, and leaves nothing out."""

import os
import re
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

from scripts.docs import ROOT, faults_of
from scripts.reference import command_line, filters, keys
from scripts.reference.__main__ import PAGES
from scripts.reference.families import FAMILIES
from urc._environment import SETTING, VARIABLES
from urc.cli.main import VERBS
from urc.config.codes import pages
from urc.filters.table import FILTERS, NUMBER_NAMES
from urc.wire import client_messages, server_messages

DOCS = ROOT / "docs"
KEYS = [name for name in PAGES if name.startswith("reference/keys/")]


@cache
def text_of(name: str) -> str:
    """Return the text of a generated page."""
    return PAGES[name]()


def headings(name: str) -> list[str]:
    """Return the headings of a generated page, below its title."""
    return re.findall(r"^##+ (.+)$", text_of(name), re.MULTILINE)


@pytest.mark.cases(100)
@pytest.mark.parametrize("name", PAGES)
def test_page_is_what_the_code_says(name: str) -> None:
    """A schema, an option or a message that was changed needs `python -m scripts.reference`."""
    assert (DOCS / name).read_text("utf-8") == text_of(name)


def test_no_page_of_keys_is_left_over() -> None:
    """A family that was renamed takes its page along."""
    found = {f"reference/keys/{file.name}" for file in (DOCS / "reference/keys").glob("*.md")}
    assert found == set(KEYS)


def test_every_property_has_a_description_and_an_example() -> None:
    """An option without its text or example has no page worth the name."""
    assert keys.missing() == []


def test_every_definition_is_in_one_family() -> None:
    """A new definition of a schema needs a row in scripts/reference/families.py."""
    named = Counter(one for family in FAMILIES.values() for one in family.definitions)
    assert named == Counter(list(keys.definitions()))


def test_every_property_of_every_definition_has_its_section() -> None:
    """Counted in the schemas; the shared keys of transports have theirs at the first of all."""
    common = keys.definitions()[keys.COMMON]["properties"]
    wanted: set[str] = set()
    for address, schema in keys.definitions().items():
        short = address.rpartition(":")[2]
        shared = set(common) - {"type"} if is_transport(schema) else set()
        own = [key for key in schema.get("properties", {}) if key not in shared]
        wanted |= {short, *(f"{short}.{key}" for key in own)}
    found = {heading for name in KEYS for heading in headings(name)}
    assert wanted <= found
    assert {f"anyTransport.{key}" for key in common} <= found


def is_transport(schema: keys.Schema) -> bool:
    """Return whether a definition has the keys of every transport, which are told once."""
    properties = schema.get("properties", {})
    return {"type", "timeouts", "reconnect"} <= set(properties) and len(properties) > 8


@pytest.mark.parametrize("name", PAGES)
def test_every_link_of_a_page_leads_somewhere(name: str) -> None:
    """Types are links to where they are described, on this page or another one."""
    assert list(faults_of(DOCS / name)) == []


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_and_option_has_an_anchor(verb: str) -> None:
    """By the parser itself."""
    found = headings("reference/cli.md")
    parser = command_line.parser_of(verb)
    words = [word for action in parser._actions for word in action.option_strings[-1:]]
    assert f"urc {verb}" in found
    assert {f"urc {verb} {word}" for word in words} <= set(found)


def test_every_code_has_an_anchor() -> None:
    """As `urc explain` lists them."""
    assert headings("reference/codes.md") == list(pages())


def test_every_filter_has_an_example() -> None:
    """Number types are listed by name, because each does the same."""
    assert set(filters.EXAMPLES) == set(FILTERS) - set(NUMBER_NAMES)


def test_every_message_of_the_socket_is_told() -> None:
    """Each tag has a heading."""
    tags = [
        one.__struct_config__.tag
        for module in (client_messages, server_messages)
        for name in module.__all__
        if isinstance(one := getattr(module, name), type)
        and getattr(getattr(one, "__struct_config__", None), "tag", None)
    ]
    tags.remove("Outbound")  # the base of the others, which is never sent
    assert len(tags) > 25
    assert set(tags) <= set(headings("reference/websocket.md"))


def test_every_variable_of_the_environment_is_in_the_table() -> None:
    """No module reads a variable of URC that the table leaves out."""
    named: set[str] = set()
    for file in (ROOT / "urc").rglob("*.py"):
        named |= set(re.findall(r'"(URC_[A-Z_]+)"', file.read_text("utf-8")))
    assert named - {SETTING} <= set(VARIABLES)
    assert SETTING + "NAME" in VARIABLES


@pytest.mark.parametrize("folder", ["robots", "widgets"])
def test_the_gallery_shows_each_and_nothing_else(folder: str) -> None:
    """A card for each file or folder that ships."""
    shipped = [path.stem for path in Path(ROOT / folder).iterdir() if is_shown(folder, path)]
    links = re.findall(rf"^:link: \.\./{folder}/(.+)$", text_of(f"gallery/{folder}.md"), re.M)
    assert links == sorted(shipped)


def is_shown(folder: str, path: Path) -> bool:
    """Return whether a path is a robot or a widget."""
    if folder == "robots":
        return path.suffix == ".yaml"
    return os.path.isfile(path / "widget.yaml")

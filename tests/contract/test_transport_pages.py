"""The pages about transports: their robots load and pass their tests, and every option is told."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.documentation import Block, blocks
from urc.config.load import WidgetFolder, check
from urc.config.schemas import read_schema
from urc.runtime.document_tests import exercise
from urc.runtime.registries import built_in_catalog
from urc.transports.table import TRANSPORTS

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    page for page in sorted((ROOT / "docs" / "transports").glob("*.md")) if page.stem in TRANSPORTS
]
ROBOTS = [
    block
    for page in PAGES
    for block in blocks(page)
    if block.language == "yaml" and "kind: robot" in block.text
]
DEFINITIONS: dict[str, Any] = read_schema("driver.schema.json")["$defs"]
COMMON = set(DEFINITIONS["anyTransport"]["properties"])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page_has_a_robot_to_start_from(page: Path) -> None:
    """A whole one, with a transport of that type."""
    own = [block for block in ROBOTS if block.page == page]
    assert own
    for block in own:
        types = {one["type"] for one in yaml.safe_load(block.text)["transports"].values()}
        assert page.stem in types


@pytest.mark.parametrize("block", ROBOTS, ids=str)
def test_robot_of_a_page_is_without_a_finding(block: Block, tmp_path: Path) -> None:
    """Not even a warning, and its tests pass."""
    path = tmp_path / f"{yaml.safe_load(block.text)['name']}.yaml"
    path.write_text(block.text, "utf-8")
    checked = check(str(path), built_in_catalog(), WidgetFolder(tmp_path / "widgets"))
    assert [str(problem) for problem in checked.problems] == []
    assert checked.profile is not None
    assert checked.profile.tests
    assert exercise(checked.profile).problems == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_option_is_told(page: Path) -> None:
    """In words: what an editor offers, the page explains."""
    text = page.read_text("utf-8")
    own = set(DEFINITIONS[page.stem]["properties"]) - COMMON
    assert [key for key in sorted(own) if f"`{key}" not in text] == []

"""The page about tests says what is so, and leaves no key out."""

import re
from pathlib import Path

import pytest
import yaml

from urc.config.load import check
from urc.config.schemas import read_schema
from urc.problems import to_text
from urc.runtime.coverage import measure
from urc.runtime.document_tests import exercise
from urc.runtime.registries import built_in_catalog

PAGE = (Path(__file__).parents[2] / "docs" / "language" / "tests.md").read_text("utf-8")
BLOCKS = re.findall(r"^```yaml\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("block", BLOCKS, ids=range(len(BLOCKS)))
def test_robot_of_the_page_passes_its_tests(block: str, tmp_path: Path) -> None:
    """Without a finding, and with nothing left out."""
    file = tmp_path / f"{yaml.safe_load(block)['name']}.yaml"
    file.write_text(block, "utf-8")
    checked = check(file, built_in_catalog())
    assert [to_text(one) for one in checked.problems] == []
    assert checked.profile is not None
    outcome = exercise(checked.profile)
    assert [to_text(one) for one in outcome.problems] == []
    assert measure("", checked.profile.driver, outcome.exercised).untested == ()


def test_every_key_is_told() -> None:
    """In words, and most of them in the example."""
    definitions = read_schema("driver.schema.json")["$defs"]
    mappings = (
        "test",
        "testStep",
        "testMessage",
        "testState",
        "simulatorRule",
        "simulatorReaction",
    )
    keys = {key for name in mappings for key in definitions[name]["properties"]} - {"value"}
    assert [key for key in sorted(keys) if not re.search(rf"`{key}\b", PAGE)] == []

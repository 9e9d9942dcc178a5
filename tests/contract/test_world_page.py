"""The page about the world says what is so, and leaves no key, input or reading out."""

import re
from pathlib import Path

import pytest
import yaml

from tests.contract.test_protocols import Conversation
from urc.config.load import check
from urc.config.schemas import read_schema
from urc.model.world import INPUTS, READINGS
from urc.problems import to_text
from urc.runtime.coverage import measure
from urc.runtime.document_tests import exercise
from urc.runtime.registries import built_in_catalog
from urc.simulator.faults import FAULTS

PAGE = (Path(__file__).parents[2] / "docs" / "language" / "world.md").read_text("utf-8")
BLOCKS = re.findall(r"^```yaml\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("block", BLOCKS, ids=range(len(BLOCKS)))
def test_robot_of_the_page_passes_its_tests_and_says_all_that_it_has(
    block: str, tmp_path: Path
) -> None:
    """Without a finding, with nothing left out, and every signal gets a value from its world."""
    file = tmp_path / f"{yaml.safe_load(block)['name']}.yaml"
    file.write_text(block, "utf-8")
    checked = check(file, built_in_catalog())
    assert [to_text(one) for one in checked.problems] == []
    profile = checked.profile
    assert profile is not None
    outcome = exercise(profile)
    assert [to_text(one) for one in outcome.problems] == []
    assert measure("", profile.driver, outcome.exercised).untested == ()
    talk = Conversation(profile)
    talk.begin()
    talk.wait(5.0)
    refused = {name: line.last_fault for name, line in talk.lines.items() if line.faults}
    assert (talk.faults, refused) == ([], {})
    assert talk.read == {*profile.driver.signals}


def test_every_key_is_told() -> None:
    """In words or in a table."""
    definitions = read_schema("driver.schema.json")["$defs"]
    keys = {
        key
        for name, one in definitions.items()
        if name.startswith("world")
        for key in one["properties"]
    }
    assert [key for key in sorted(keys) if not re.search(rf"`(world\.)?{key}\b", PAGE)] == []


def test_every_body_input_reading_and_fault_is_told() -> None:
    """By the name that a document uses."""
    names = {*INPUTS, *(name for inputs in INPUTS.values() for name in inputs), *READINGS}
    names |= {part for parts in READINGS.values() for part in parts} - {"qy", "qz"}
    assert [one for one in sorted(names) if not re.search(rf"`(world\.)?{one}\b", PAGE)] == []
    assert [one for one in FAULTS.values() if f"`{one}`" not in PAGE] == []

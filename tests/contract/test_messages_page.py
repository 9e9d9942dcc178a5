"""The page about messages says what is so, and leaves no key out."""

import re
from pathlib import Path

import pytest

from urc.config.load import check
from urc.config.messaging import MESSAGING
from urc.config.schemas import read_schema
from urc.problems import to_text
from urc.runtime.registries import built_in_catalog

PAGE = (Path(__file__).parents[2] / "docs" / "language" / "messages.md").read_text("utf-8")
BLOCKS = re.findall(r"^```yaml\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("block", BLOCKS)
def test_every_robot_of_the_page_can_be_used(block: str, tmp_path: Path) -> None:
    """Without a finding."""
    found = re.search(r"^name: (\S+)$", block, re.MULTILINE)
    assert found is not None
    path = tmp_path / f"{found[1]}.yaml"
    path.write_text(block)
    checked = check(str(path), built_in_catalog())
    assert [to_text(one) for one in checked.problems] == []


def test_every_key_is_told_and_shown() -> None:
    """In words, and in an example."""
    definitions = read_schema("driver.schema.json")["$defs"]
    forms = ("publishForm", "callForm", "goalForm", "cancelForm", "requestForm", "subscribe")
    keys = {key for name in forms for key in definitions[name]["properties"]}
    keys |= {verb for one in MESSAGING.values() for verb in one.verbs} | {
        "subscribe",
        "raw",
        "tunnel",
    }
    shown = "".join(BLOCKS)
    bodies = {"hex", "bytes", "struct"}  # of the page about binary frames
    assert [key for key in sorted(keys) if f"`{key}" not in PAGE and f"{key}:" not in shown] == []
    assert [key for key in sorted(keys - bodies) if not re.search(rf"\b{key}:", shown)] == []


def test_the_keys_of_subscribe_are_those_of_the_schema() -> None:
    """What the loader refuses on one transport exists on another one."""
    keys = set(read_schema("driver.schema.json")["$defs"]["subscribe"]["properties"])
    assert keys == {"topic"}.union(*(one.listen for one in MESSAGING.values()))

"""The page on framing: its examples are right, and no key of the schema is missing from it."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.unit.protocol.framing_samples import framing
from urc.config.schemas import read_schema
from urc.model.framing import FOLDED, PLAIN_CHECKSUMS
from urc.protocol.framing.table import FRAMINGS

PAGE = (Path(__file__).parents[2] / "docs" / "language" / "framing.md").read_text("utf-8")
BLOCKS = re.findall(r"^```yaml\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
DEFINITIONS = (
    *(f"{name}Framing" for name in FRAMINGS),
    *("lengthField", "payloadWindow", "switchCase", "checksum", "crcAlgorithm", "foldAlgorithm"),
    *("checksumWindow", "saltTable", "escape"),
)


def declared(block: str) -> Any:
    """Return the framing in an example; a checksum alone stands in a framing that takes any."""
    data = yaml.safe_load(block)
    if "checksum" in data:
        return {"type": "slip", "checksum": data["checksum"]}
    if "framing" in data:
        return data["framing"]
    for kind, key in (("transports", "wire"), ("commands", "firmware")):
        if kind in data:
            inner = data[kind][key]
            return inner.get("framing") or inner["reply"]["framing"]
    raise AssertionError(block)


@pytest.mark.parametrize("block", BLOCKS)
def test_example_of_the_page_cuts_frames(block: str) -> None:
    """Each is parsed without a finding and makes a decoder."""
    text = yaml.safe_dump(declared(block), default_flow_style=True, width=10**6, sort_keys=False)
    assert framing(text.strip()).decoder().pending == 0


@pytest.mark.parametrize("name", DEFINITIONS)
def test_every_key_is_on_the_page(name: str) -> None:
    """A key that the page does not name is found by nobody."""
    definition = read_schema("driver.schema.json")["$defs"][name]
    missing = [key for key in definition["properties"] if not re.search(rf"\b{key}\b", PAGE)]
    assert missing == []


def test_every_type_and_own_checksum_is_on_the_page() -> None:
    """The CRCs are those of their catalogue."""
    assert [kind for kind in FRAMINGS if f"`{kind}`" not in PAGE] == []
    assert [name for name in (*FOLDED, *PLAIN_CHECKSUMS) if f"`{name}`" not in PAGE] == []

"""The page about binary frames says what is so, and leaves no key out."""

import re
from pathlib import Path

import pytest

from urc.config.messaging import MESSAGING
from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext, parse_write
from urc.config.schemas import read_schema
from urc.problems import to_text
from urc.source import parse_document
from urc.testing.struct import reader, struct_read

PAGE = (Path(__file__).parents[2] / "docs" / "language" / "binary.md").read_text("utf-8")
BLOCKS = re.findall(r"^```yaml\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("block", [one for one in BLOCKS if "struct:" in one])
def test_struct_of_the_page_can_be_used(block: str) -> None:
    """Without a finding, and in both directions."""
    assert struct_read(block).fields
    reader(block)


@pytest.mark.parametrize("block", [one for one in BLOCKS if one.startswith("send:")])
def test_send_of_the_page_can_be_used(block: str) -> None:
    """Without a finding."""
    document = parse_document(block, "page.yaml")
    problems = Problems()
    spec = parse_write(Node(document, (), document.data).must("send"), problems, FormContext())
    assert [to_text(one) for one in problems] == []
    assert spec.names


def test_every_key_is_told_and_shown() -> None:
    """In words, and in an example."""
    definitions = read_schema("driver.schema.json")["$defs"]
    keys = {
        key
        for name in ("longItem", "bitPart", "sendForm")
        for key in definitions[name]["properties"]
    } | {"by", "cases", "else", "types", "enums", "min", "max"}
    keys -= {verb for one in MESSAGING.values() for verb in one.verbs}  # a page of their own
    examples = "".join(BLOCKS)
    assert [key for key in sorted(keys) if not re.search(rf"`[^`]*\b{key}\b[^`]*`", PAGE)] == []
    assert [key for key in sorted(keys) if not re.search(rf"\b{key}:", examples)] == []


def test_every_block_is_tested() -> None:
    """A block of another kind would be checked by nobody."""
    assert all("struct:" in block or block.startswith("send:") for block in BLOCKS)

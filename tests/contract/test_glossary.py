"""The glossary: each term once, and a name that stands in the tree."""

import ast
import json
import re
from pathlib import Path

import pytest

from scripts.structure import every_statement
from tests.contract.modules import MODULES, tree_of

ROOT = Path(__file__).resolve().parents[2]
GLOSSARY = (ROOT / "docs" / "glossary.md").read_text("utf-8")
TERMS, _, REPLACED = GLOSSARY.partition("## Words that URC does not use")


def rows(text: str, columns: int) -> list[list[str]]:
    """Return the cells of every table row below its head."""
    found = [
        [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        for line in text.splitlines()
        if line.startswith("| ")
    ]
    return [row for row in found if len(row) == columns and row[0] not in ("term", "instead of")]


def names_of_code() -> set[str]:
    """Return the name of every class of URC and of every key of the documents."""
    found = {
        node.name
        for file in MODULES
        for node in every_statement(tree_of(file))
        if isinstance(node, ast.ClassDef)
    }
    waiting: list[object] = [
        json.loads(file.read_text("utf-8")) for file in (ROOT / "schemas").glob("*.json")
    ]
    while waiting:
        part = waiting.pop()
        if isinstance(part, dict):
            found |= part.get("properties", {}).keys()
            waiting += part.values()
        elif isinstance(part, list):
            waiting += part
    return found | {folder.name for folder in (ROOT / "widgets").iterdir()}


NAMES = names_of_code()


def test_each_term_stands_once() -> None:
    """One meaning for each word, and none that is also a word to avoid."""
    terms = [term for row in rows(TERMS, 4) for term in row[0].split(", ")]
    assert len(terms) > 100
    assert [term for term in terms if terms.count(term) > 1] == []
    assert {row[0] for row in rows(REPLACED, 2)} & set(terms) == set()


@pytest.mark.parametrize("row", rows(TERMS, 4), ids=lambda row: row[0])
def test_the_name_of_a_term_exists(row: list[str]) -> None:
    """A class, a key of a document, a widget, a verb of the command line, or a path."""
    names = re.findall(r"`([^`]+)`", row[2])
    assert names
    for name in names:
        assert name in NAMES or name.startswith("urc ") or (ROOT / name).exists()

"""Every broken document gives exactly the report beside it: never a traceback, always a place.

After a wanted change of a text, write the reports anew and read each difference:
``python tests/contract/test_broken_documents.py --update``.
"""

import os
import sys
from pathlib import Path

import pytest

from urc.config.load import WidgetFolder, check
from urc.problems import to_text
from urc.runtime.registries import built_in_catalog

BROKEN = Path(__file__).parents[1] / "broken"
SUPPORT = ("parts", "shelf")
"""Folders of good documents, and of bad ones that are reached through others only."""
DOCUMENTS = sorted(
    path.relative_to(BROKEN).as_posix()
    for path in BROKEN.rglob("*.yaml")
    if path.relative_to(BROKEN).parts[0] not in SUPPORT
)


def report(document: str) -> str:
    """Return what `urc validate` prints about a document, from the folder of broken documents."""
    checked = check(document, built_in_catalog(), WidgetFolder(BROKEN / "shelf"))
    return "".join(f"{to_text(problem)}\n" for problem in checked.problems)


def expected_file(document: str) -> Path:
    return BROKEN / document.replace(".yaml", ".expected.txt")


@pytest.mark.cases(150)
@pytest.mark.parametrize("document", DOCUMENTS)
def test_broken_document_gives_exactly_this_report(
    document: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The whole text is compared: code, place, words, source line, caret and hint."""
    monkeypatch.chdir(BROKEN)
    assert report(document) == expected_file(document).read_text("utf-8")


def test_every_report_belongs_to_a_document() -> None:
    """A report whose document is gone would be checked by nobody."""
    reports = {path.relative_to(BROKEN).as_posix() for path in BROKEN.rglob("*.expected.txt")}
    assert reports == {name.replace(".yaml", ".expected.txt") for name in DOCUMENTS}


def test_there_are_enough_of_them() -> None:
    """The collection may grow, not shrink."""
    assert len(DOCUMENTS) >= 60


def _update() -> None:
    os.chdir(BROKEN)
    for document in DOCUMENTS:
        expected_file(document).write_text(report(document), "utf-8")


if __name__ == "__main__" and sys.argv[1:] == ["--update"]:
    _update()

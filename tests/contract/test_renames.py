"""All documents of the tree have present names, and `urc migrate` leaves them as they are."""

from pathlib import Path

import pytest

from urc.cli.main import main
from urc.config.codes import pages
from urc.config.migrate import migrate
from urc.config.renames import CODES
from urc.problems import ProblemsError

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("robots", "widgets", "tests", "urc", "bench")


def documents() -> list[Path]:
    """Return every YAML file of the folders, without what programs have put there."""
    found = (path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.yaml")))
    return [path for path in found if "/." not in f"/{path.relative_to(ROOT).as_posix()}"]


def test_no_document_of_the_tree_has_an_old_name() -> None:
    """Files of other kinds, and texts that are no YAML, are left out; most are documents."""
    unchanged = 0
    for path in documents():
        try:
            migrated = migrate(str(path))
        except ProblemsError:
            continue
        assert migrated == (path.read_bytes(), ()), path
        unchanged += 1
    assert unchanged > 500


def test_every_renamed_code_leads_to_a_page() -> None:
    """No old code is in use; a chain of renames would mislead."""
    known = pages()
    assert [new for new in CODES.values() if new not in known] == []
    assert [old for old in CODES if old in known] == []


def test_every_robot_is_checked(capsys: pytest.CaptureFixture[str]) -> None:
    """As a person would, before they write to a file."""
    assert main(["migrate", "--check", *map(str, sorted((ROOT / "robots").glob("*.yaml")))]) == 0
    assert "would rename" not in capsys.readouterr().out

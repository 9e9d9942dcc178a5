"""SECURITY.md and the page of advisories: what people look for is there, and agrees."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
POLICY = (ROOT / "SECURITY.md").read_text("utf-8")
ADVISORIES = (ROOT / "docs" / "advisories.md").read_text("utf-8")
ROW = re.compile(
    r"\| URC-20\d\d-\d{4}(?: / CVE-\d{4}-\d+)? \| \d{4}-\d\d-\d\d \| [^|]+ \| \d+\.\d+\.\d+ \|"
    r" (?:low|medium|high|critical) \(\d+\.\d\) \| [^|]+ \|"
)


def test_the_policy_says_how_to_report() -> None:
    """Reports go to the private advisories of the repository, not to an e-mail address."""
    for heading in ("Supported versions", "Report a vulnerability", "Response"):
        assert f"## {heading}\n" in POLICY
    assert "“Report a vulnerability”" in POLICY
    assert "@" not in POLICY


def test_people_find_the_policy() -> None:
    for page in ("README.md", "docs/security.md", "docs/advisories.md"):
        assert "SECURITY.md)" in (ROOT / page).read_text("utf-8"), page
    for page in ("security.md", "threats.md", "advisories.md"):
        assert f"({page})" in (ROOT / "docs/README.md").read_text("utf-8"), page


def test_each_advisory_has_a_whole_row_and_a_line_in_the_changelog() -> None:
    """An empty table says that it is empty."""
    _, _, table = ADVISORIES.partition("|---|---|---|---|---|---|\n")
    rows = [line for line in table.splitlines() if line.startswith("|")]
    assert bool(rows) is ("No advisory has been published so far." not in ADVISORIES)
    changelog = (ROOT / "CHANGELOG.md").read_text("utf-8")
    for row in rows:
        assert ROW.fullmatch(row), row
        assert row.split()[1] in changelog

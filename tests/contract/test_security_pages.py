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
    assert "SECURITY.md)" in (ROOT / "README.md").read_text("utf-8")
    assert "SECURITY.md" in (ROOT / "docs/project/vulnerabilities.md").read_text("utf-8")
    for page in ("security.md", "advisories.md"):
        assert "project/vulnerabilities.md)" in (ROOT / "docs" / page).read_text("utf-8"), page
    for index, page in (("explanation", "security"), ("project", "advisories")):
        assert f"(../{page}.md)" in (ROOT / f"docs/{index}/index.md").read_text("utf-8"), page


def test_each_advisory_has_a_whole_row_and_a_line_in_the_changelog() -> None:
    """An empty table says that it is empty."""
    _, _, table = ADVISORIES.partition("|---|---|---|---|---|---|\n")
    rows = [line for line in table.splitlines() if line.startswith("|")]
    assert bool(rows) is ("No advisory has been published so far." not in ADVISORIES)
    changelog = (ROOT / "CHANGELOG.md").read_text("utf-8")
    for row in rows:
        assert ROW.fullmatch(row), row
        assert row.split()[1] in changelog

"""docs/threats.md: a row for each threat and requirement, and tests that exist in each row."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "threats.md").read_text("utf-8")
ROWS = {
    cells[0]: cells[1:]
    for cells in (
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in PAGE.splitlines()
        if re.match(r"\| [TPK]\d+ \|", line)
    )
}
CONTRACT = (ROOT / "docs" / "motion-promises.md").read_text("utf-8")
PROMISES = set(re.findall(r"^\| ([SR]\d+) \|", CONTRACT, re.M))


def ids(letter: str, most: int) -> list[str]:
    return [f"{letter}{number}" for number in range(1, most + 1)]


def proofs_of(row: str) -> list[str]:
    return re.findall(r"`([^`]+)`", ROWS[row][-1])


def test_no_threat_and_no_requirement_is_left_out() -> None:
    """Rows stand once, in their order."""
    wanted = [*ids("T", 31), *ids("P", 27), *ids("K", 11)]
    assert re.findall(r"^\| ([TPK]\d+) \|", PAGE, re.M) == wanted


@pytest.mark.parametrize("row", ROWS)
def test_each_named_test_exists(row: str) -> None:
    """A row without a test is an open requirement, and says so."""
    tests = proofs_of(row)
    assert bool(tests) is (ROWS[row][-2] != "open")
    for file in tests:
        assert re.fullmatch(r"tests/.+/test_\w+\.py", file), file
        assert (ROOT / file).is_file(), file


@pytest.mark.parametrize("row", [one for one in ROWS if not one.startswith("T")])
def test_each_requirement_has_a_state_of_the_list(row: str) -> None:
    """A state other than done names the missing part."""
    assert re.fullmatch(r"done|open|partly: \*.+\*", ROWS[row][-2])


@pytest.mark.parametrize("row", ids("T", 31))
def test_each_threat_names_requirements_that_exist(row: str) -> None:
    """Of this page, or of the motion contract."""
    named = set(re.findall(r"\b[SRPK]\d+\b", ROWS[row][1]))
    assert named
    assert named <= PROMISES | ROWS.keys()


def test_each_requirement_answers_a_threat() -> None:
    """Requirements without a threat would be decoration; these have none of their own."""
    named: set[str] = set()
    for row in ids("T", 31):
        for first, last in re.findall(r"\b([PK]\d+)(?:–([PK]\d+))?", ROWS[row][1]):
            until = int((last or first)[1:])
            named |= {f"{first[0]}{number}" for number in range(int(first[1:]), until + 1)}
    general = {"P21", "P22", "P23", "P24", "K5", "K11"}
    assert {one for one in ROWS if not one.startswith("T")} - named == general

"""The comparison of two commits: a rename explains a new column or code, and nothing else."""

from pathlib import Path

from scripts.compare_reports import BROKEN, Comparison

OLD = "urc: 1\nkind: interface\nname: x\ngrids: { wide: a, low: 1 }\n"
FOUND = ["x.yaml", 4, 24, "warning", "silent"]
MOVED = ["x.yaml", 4, 43, "warning", "no-data"]


def compared(folder: Path, problem: list[object]) -> Comparison:
    """Compare the report of `OLD` with `problem`."""
    home = folder / BROKEN
    home.mkdir(parents=True)
    (home / "x.yaml").write_text(OLD, "utf-8")
    comparison = Comparison(folder, None)
    comparison.compare_reports({"x.yaml": [FOUND]}, {"x.yaml": [problem]})
    return comparison


def test_a_problem_behind_a_renamed_key_is_the_same(tmp_path: Path) -> None:
    """The three keys before it grew, its code has a new name."""
    comparison = compared(tmp_path, MOVED)
    assert not comparison.is_different
    assert comparison.counts["reports equal"] == 1
    assert comparison.counts["problems in a new column"] == 1


def test_another_place_severity_or_code_is_a_difference(tmp_path: Path) -> None:
    """Each alone."""
    for place, value in ((1, 5), (2, 24), (3, "error"), (4, "silent")):
        problem = [*MOVED[:place], value, *MOVED[place + 1 :]]
        comparison = compared(tmp_path / str(place), problem)
        assert comparison.is_different
        assert comparison.counts["problems only before"] == 1
        assert comparison.counts["problems only after"] == 1

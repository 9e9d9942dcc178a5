"""`./dev mutate`: its copy of the tree, what it tries again, and what it says of survivors."""

import json
import os
import re
import tomllib
from pathlib import Path

import pytest

from scripts import mutate
from scripts.mutants import Explained, Kind, Mutant, explained_in, mutants_in, table
from scripts.mutation_copy import (
    Settings,
    bring_up_to_date,
    forget_open_questions,
    with_plain_properties,
)

ROOT = Path(__file__).resolve().parents[2]
SETTINGS = Settings(("urc/guard/*",), ("urc/guard/double.py",), ("urc", "tests"))
SOURCE = '''\
class MotionScheduler:
    @property
    def owes(self) -> bool:
        """Whether a stop is owed."""
        return bool(self.debts)

    @staticmethod
    def other() -> int:
        return 1

    def tick(self) -> None:
        self.moves = True
'''
MUTATED = """\
class MotionScheduler:
    def xǁMotionSchedulerǁtick__mutmut_orig(self) -> None:
        self.moves = True
    def xǁMotionSchedulerǁtick__mutmut_1(self) -> None:
        self.moves = False
    def xǁMotionSchedulerǁtick__mutmut_2(self) -> None:
        self.moves = None
"""
TICK = "urc.guard.motion_scheduler.xǁMotionSchedulerǁtick__mutmut_"


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A tree with one module that is mutated, and one that is not."""
    for name, text in {"urc/guard/motion_scheduler.py": SOURCE, "urc/other.py": SOURCE}.items():
        path = tmp_path / "tree" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")
    return tmp_path / "tree"


def ran(copy: Path, **codes: int | None) -> Path:
    """Leave what a run leaves: its mutants, and how they ended."""
    path = copy / "mutants" / "urc" / "guard" / "motion_scheduler.py"
    path.parent.mkdir(parents=True)
    path.write_text(MUTATED, "utf-8")
    spans = {"orig": [2, 3], "1": [4, 5], "2": [6, 7]}
    named = {f"xǁMotionSchedulerǁtick__mutmut_{name}": span for name, span in spans.items()}
    Path(f"{path}.spans").write_text(json.dumps({"version": 1, "spans": named}), "utf-8")
    meta = {"exit_code_by_key": {f"{TICK}{name[1:]}": code for name, code in codes.items()}}
    Path(f"{path}.meta").write_text(json.dumps(meta), "utf-8")
    (copy / "mutants" / "mutmut-stats.json").write_text("{}")
    return path


def statuses(copy: Path) -> dict[str, str]:
    """Return the status of each mutant, by its number."""
    return {one.name.removeprefix(TICK): one.status for one in mutants_in(copy, SETTINGS)}


def test_a_property_is_a_method_that_can_be_mutated() -> None:
    """It does what it did, by the name that it had; other decorators stay."""
    plain = with_plain_properties(SOURCE)
    names: dict[str, type] = {}
    exec(plain, names)  # noqa: S102 - our own text
    motion_scheduler = names["MotionScheduler"]()
    motion_scheduler.debts = ["drive"]
    assert motion_scheduler.owes is True
    assert motion_scheduler.owes_as_method() is True
    assert motion_scheduler.other() == 1
    assert plain.count("@") == 1


def test_each_module_that_is_mutated_stays_one_that_python_reads() -> None:
    settings = Settings.of(ROOT)
    found = 0
    for path in (ROOT / "urc").rglob("*.py"):
        if settings.is_mutated(path.relative_to(ROOT).as_posix()):
            plain = with_plain_properties(path.read_text("utf-8"))
            compile(plain, str(path), "exec")
            assert "@property" not in plain
            found += 1
    assert found > 20


def test_the_copy_follows_the_tree(tree: Path, tmp_path: Path) -> None:
    """What did not change keeps its time, so that its mutants stand; what is gone goes."""
    copy = tmp_path / "copy"
    assert bring_up_to_date(tree, copy, SETTINGS)
    assert "owes_as_method" in (copy / "urc" / "guard" / "motion_scheduler.py").read_text("utf-8")
    assert (copy / "urc" / "other.py").read_text("utf-8") == SOURCE
    os.utime(copy / "urc" / "other.py", (1, 1))
    assert not bring_up_to_date(tree, copy, SETTINGS)
    (tree / "urc" / "guard" / "motion_scheduler.py").unlink()
    ran(copy, _1=1)
    assert bring_up_to_date(tree, copy, SETTINGS)
    assert (copy / "urc" / "other.py").stat().st_mtime == 1
    left = [path.name for path in copy.rglob("motion_scheduler*")]
    assert left == []


def test_after_a_change_all_that_lives_is_tried_again(tmp_path: Path) -> None:
    """What was killed stays so; the list of tests for each function is made anew."""
    ran(tmp_path, _1=1, _2=0)
    assert statuses(tmp_path) == {"1": "killed", "2": "survived"}
    forget_open_questions(tmp_path)
    assert statuses(tmp_path) == {"1": "killed", "2": "waiting"}
    assert not (tmp_path / "mutants" / "mutmut-stats.json").exists()


@pytest.mark.parametrize(
    ("code", "status"),
    [
        (3, "killed"),
        (-15, "killed"),
        (-24, "timeout"),
        (36, "timeout"),
        (33, "no tests"),
        (-11, "odd"),
    ],
)
def test_how_a_run_ended(tmp_path: Path, code: int, status: str) -> None:
    ran(tmp_path, _1=code)
    assert statuses(tmp_path) == {"1": status}


def test_a_comment_at_the_end_of_a_line_is_no_part_of_a_change(tmp_path: Path) -> None:
    """So another wording of the comment needs no other explanation."""
    path = ran(tmp_path, _1=0)
    commented = MUTATED.replace("True\n", "True  # so far\n").replace(
        "False\n", "False  # so far\n"
    )
    path.write_text(commented, "utf-8")
    (first,) = mutants_in(tmp_path, SETTINGS)
    assert first.change == ("self.moves = True", "self.moves = False")


def test_a_mutant_says_where_it_is_and_what_it_changes(tmp_path: Path) -> None:
    ran(tmp_path, _1=0, _2=0)
    first, _ = mutants_in(tmp_path, SETTINGS)
    assert first.function == "urc.guard.motion_scheduler.MotionScheduler.tick"
    assert first.change == ("self.moves = True", "self.moves = False")
    plain = "urc.guard.motion_scheduler.xǁMotionSchedulerǁowes_as_method__mutmut_1"
    assert (
        Mutant(tmp_path, "urc.guard.motion_scheduler", plain, "").function
        == "urc.guard.motion_scheduler.MotionScheduler.owes"
    )
    alone = "urc.guard.motion_scheduler.x_look__mutmut_7"
    assert (
        Mutant(tmp_path, "urc.guard.motion_scheduler", alone, "").function
        == "urc.guard.motion_scheduler.look"
    )


EXPLAINED = """
[[mutant]]
function = "urc.guard.motion_scheduler.MotionScheduler.tick"
why = "nobody looks"
changes = [["self.moves = True", "self.moves = False"]]

[[kind]]
why = "as true as True"
before = '(\\S+) = True'
after = '\\1 = None'
"""


def summary(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, **codes: int | None
) -> tuple[int, str]:
    """Return exit code and words of a report."""
    ran(tmp_path, **codes)
    path = tmp_path / "mutants.toml"
    path.write_text(text, "utf-8")
    mutants = mutants_in(tmp_path, SETTINGS)
    code = mutate.summarise(mutants, explained_in(path), is_part=False)
    return code, capsys.readouterr().out


def test_what_is_explained_is_not_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By its own change, or by its kind. But 90 % are to be killed."""
    code, said = summary(tmp_path, capsys, EXPLAINED, _1=0, _2=0)
    assert "survived:" not in said
    assert "0 surviving mutants are not explained" in said
    assert code == 1


def test_a_survivor_is_told_with_its_change(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said = summary(tmp_path, capsys, "", _1=1, _2=0)
    assert f"survived: {TICK}2" in said
    assert "  -        self.moves = True\n  +        self.moves = None" in said
    assert "1 surviving mutants are not explained" in said
    assert code == 1


def test_an_explanation_that_is_not_needed_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said = summary(tmp_path, capsys, EXPLAINED, _1=1, _2=36)
    assert (
        "mutants.toml: no surviving mutant matches this explanation: "
        "urc.guard.motion_scheduler.MotionScheduler.tick" in said
    )
    assert code == 0


def test_a_run_that_was_stopped_says_that_there_is_more(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said = summary(tmp_path, capsys, "", _1=1, _2=None)
    assert "1 mutants are untested: run ./dev mutate again" in said
    assert code == 3


def test_mutants_that_hung_can_be_tried_again(tmp_path: Path) -> None:
    """A test may be too slow for another reason."""
    ran(tmp_path, _1=36, _2=1)
    assert mutate.hung(mutants_in(tmp_path, SETTINGS)) == [f"{TICK}1"]


def test_the_table_has_a_line_for_each_module(tmp_path: Path) -> None:
    """Shares are of those that were tried."""
    ran(tmp_path, _1=1, _2=0, _3=None)
    mutants = mutants_in(tmp_path, SETTINGS)
    head, module, all_of_them = table(mutants, Explained({}))
    assert head.split()[:4] == ["killed", "timeout", "survived", "explained"]
    assert module.split() == [
        "urc.guard.motion_scheduler",
        "1",
        "0",
        "1",
        "0",
        "0",
        "0",
        "1",
        "3",
        "50.0",
    ]
    assert all_of_them.split()[0] == "all"


def test_a_kind_fits_the_whole_of_a_change() -> None:
    kind = Kind(re.compile(r"(\w+) = False"), r"\1 = None")
    assert kind.fits(("moves = False", "moves = None"))
    assert not kind.fits(("moves = False", "other = None"))
    assert not kind.fits(("if moves = False", "moves = None"))


def test_the_explanations_that_ship_can_be_read() -> None:
    explained = explained_in(ROOT / "tests" / "mutants.toml")
    assert all(explained.reasons.values())


def test_a_run_has_every_test_of_the_desk() -> None:
    """A fault that only a left-out test notices counts as a survivor."""
    told = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["mutmut"]
    run = told["pytest_add_cli_args_test_selection"]
    controller = [
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "tests" / "unit" / "runtime").glob("test_*.py")
        if "tests.unit.runtime.desks" in path.read_text("utf-8")
    ]
    assert set(controller) <= set(run)
    assert [name for name in run if not (ROOT / name).exists()] == []

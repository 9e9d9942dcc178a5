"""Run in full all tests that `./dev test` samples: every case, and twelve times as many examples.

A function with several cases is one step. All other functions of a file together form one step. An
interrupted run can be continued.
"""

import os
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from bench.figures import tell
from bench.harness import Result
from bench.kept import Kept

__all__ = ["run"]

_ROOT: Final = Path(__file__).resolve().parents[1]
_SAMPLED: Final = "from tests.effort import"
_FOLDERS: Final = ("tests/contract", "tests/e2e", "tests/unit")
"""Folders whose tests `tests/sampling.py` samples."""
_STEPS_IN_QUICK: Final = 20
"""Number of steps to run without `--full`."""
_COLLECT: Final = (sys.executable, "-m", "pytest", "--collect-only", "-q")
_RUN: Final = (sys.executable, "-m", "pytest", "-q", "-x", "--no-header")


def run(*, full: bool) -> Sequence[Result]:
    """Run the tests with full counts; without `full`, run only the first steps."""
    kept = Kept(f"tests_thorough-{full}")
    done = {str(row["test"]) for row in kept.rows}
    steps = list(_steps().items())
    for name, tests in steps if full else steps[:_STEPS_IN_QUICK]:
        if name not in done:
            kept.add({"test": name, "passed": _pass(tests)})
    rows = kept.end()
    failed = [str(row["test"]) for row in rows if not row["passed"]]
    tell({"figure": "tests_thorough", "tests": len(rows), "failed": failed})
    return [
        Result(
            name=f"thorough tests: failed steps of {len(rows)}",
            ratio=float(len(failed)),
            goal=0.0,
            baseline_ms=0.0,
            subject_ms=0.0,
            spread=1.0,
            rounds=len(rows),
        )
    ]


def _steps() -> dict[str, list[str]]:
    """Return the name of each step and the node IDs of its test functions, without parameters."""
    files = [
        str(path.relative_to(_ROOT))
        for path in sorted((_ROOT / "tests").rglob("test_*.py"))
        if _SAMPLED in path.read_text("utf-8") or _is_in_sampled_folder(path)
    ]
    done = subprocess.run(
        [*_COLLECT, *files], cwd=_ROOT, env=_thorough(), capture_output=True, text=True, check=True
    )
    found = Counter(line.partition("[")[0] for line in done.stdout.splitlines() if "::" in line)
    steps: dict[str, list[str]] = {}
    for name, cases in found.items():
        steps.setdefault(name if cases > 1 else name.partition("::")[0], []).append(name)
    return steps


def _is_in_sampled_folder(path: Path) -> bool:
    return any(path.is_relative_to(_ROOT / folder) for folder in _FOLDERS)


def _pass(tests: Sequence[str]) -> bool:
    done = subprocess.run(
        [*_RUN, *tests], cwd=_ROOT, env=_thorough(), capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        print(done.stdout, file=sys.stderr)
    return done.returncode == 0


def _thorough() -> dict[str, str]:
    return {**os.environ, "URC_THOROUGH": "1"}

"""All tests that `./dev test` samples: every case, and twelve times as many examples.

Each test function is one step. An interrupted run can be continued.
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
_ALL_SAMPLED: Final = "tests/e2e"
_TESTS_IN_QUICK: Final = 20
"""Number of test functions without `--full`."""
_COLLECT: Final = (sys.executable, "-m", "pytest", "--collect-only", "-q")
_RUN: Final = (sys.executable, "-m", "pytest", "-q", "-x", "--no-header")


def run(*, full: bool) -> Sequence[Result]:
    """Run the tests with full counts, or without `full` only the first test functions."""
    kept = Kept(f"tests_thorough-{full}")
    done = {str(row["test"]) for row in kept.rows}
    functions = _functions()
    for name in functions if full else functions[:_TESTS_IN_QUICK]:
        if name not in done:
            kept.add({"test": name, "passed": _passes(name)})
    rows = kept.end()
    failed = [str(row["test"]) for row in rows if not row["passed"]]
    tell({"figure": "tests_thorough", "tests": len(rows), "failed": failed})
    return [
        Result(
            name=f"thorough tests: failed of {len(rows)}",
            ratio=float(len(failed)),
            goal=0.0,
            baseline_ms=0.0,
            subject_ms=0.0,
            spread=1.0,
            rounds=len(rows),
        )
    ]


def _functions() -> list[str]:
    """Return the node IDs of the test functions in files that sample, without parameters."""
    files = [
        str(path.relative_to(_ROOT))
        for path in sorted((_ROOT / "tests").rglob("test_*.py"))
        if _SAMPLED in path.read_text("utf-8") or path.is_relative_to(_ROOT / _ALL_SAMPLED)
    ]
    done = subprocess.run(
        [*_COLLECT, *files], cwd=_ROOT, env=_thorough(), capture_output=True, text=True, check=True
    )
    found = Counter(line.partition("[")[0] for line in done.stdout.splitlines() if "::" in line)
    # A test without parameters runs whole in `./dev test`, unless its file samples by itself.
    return [name for name, count in found.items() if count > 1 or _samples(name)]


def _samples(name: str) -> bool:
    return _SAMPLED in (_ROOT / name.partition("::")[0]).read_text("utf-8")


def _passes(name: str) -> bool:
    done = subprocess.run(
        [*_RUN, name], cwd=_ROOT, env=_thorough(), capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        print(done.stdout, file=sys.stderr)
    return done.returncode == 0


def _thorough() -> dict[str, str]:
    return {**os.environ, "URC_THOROUGH": "1"}

"""The command `./dev mutate`: break the code in thousands of small ways, and run the tests.

mutmut generates the mutants and runs the tests, as configured in `[tool.mutmut]` of pyproject.toml,
in a copy of the tree under `.mutate`. The results are stored in the copy, so an interrupted run can
continue, and only the mutants affected by a change run again. `tests/mutants.toml` explains the
mutants that no test can kill. The exit code is 3 if mutants are untested, 0 if 90 % of all mutants
are killed and the others explained, and 1 otherwise. Decision record:
docs/decisions/0024-mutants-by-mutmut.md.
"""

import argparse
import os
import signal
import subprocess
import sys
from pathlib import Path

from scripts.mutants import DEAD, Explained, Mutant, explained_in, mutants_in, table
from scripts.mutation_copy import Settings, bring_up_to_date, forget_open_questions

ROOT = Path(__file__).resolve().parents[1]
COPY = ROOT / ".mutate"
EXPLAINED = ROOT / "tests" / "mutants.toml"
WANTED = 0.9
"""Minimum number of killed mutants, as a fraction of all mutants."""
UNFINISHED = 3
_END_S = 30
_TEST_S = 20
"""Timeout for a test in seconds, to detect mutants that hang; the slowest test takes 2 s."""


def main() -> int:
    """Run the untested mutants, print the summary, and return the exit code."""
    options = _options()
    if os.name == "nt":
        print("mutate: mutmut needs fork, which Windows does not support; use WSL", file=sys.stderr)
        return 2
    settings = Settings.of(ROOT)
    if not options.report:
        if bring_up_to_date(ROOT, COPY, settings):
            forget_open_questions(COPY)
        names = [*options.names, *(hung(mutants_in(COPY, settings)) if options.timeouts else ())]
        is_idle = options.timeouts and not names
        if not is_idle and not _run(names, options.workers, options.minutes):
            return 1
    mutants = mutants_in(COPY, settings)
    is_part = bool(options.names) or options.timeouts
    return summarise(mutants, explained_in(EXPLAINED), is_part=is_part)


def _options() -> argparse.Namespace:
    said = (__doc__ or "").partition("\n")[0]
    parser = argparse.ArgumentParser(prog="./dev mutate", description=said)
    add = parser.add_argument
    add(
        "names",
        nargs="*",
        metavar="NAME",
        help="retest the mutants with these names, such as 'urc.guard.motion_scheduler.*'",
    )
    add(
        "--minutes",
        type=float,
        metavar="N",
        help="time limit in minutes; the next run tests the rest",
    )
    add("--workers", type=int, default=2, metavar="N", help="number of workers, 2 by default")
    add("--timeouts", action="store_true", help="retest mutants that timed out")
    add("--report", action="store_true", help="show the stored results without testing mutants")
    return parser.parse_args()


def _run(names: list[str], workers: int, minutes: float | None) -> bool:
    """Run mutmut until all mutants are tested or the time limit is reached.

    Return False if mutmut failed.
    """
    mutmut = Path(sys.executable).with_name("mutmut")
    command = [str(mutmut), "run", "--max-children", str(workers), *names]
    # The copy comes before the checkout, even for programs that a test starts.
    environment = {
        **os.environ,
        "PYTHONPATH": str(COPY / "mutants"),
        "URC_TEST_TIMEOUT_S": str(_TEST_S),
        "URC_ALL_CASES": "1",  # a case that is not drawn kills no mutant
    }
    process = subprocess.Popen(command, cwd=COPY, env=environment)
    try:
        return process.wait(minutes * 60 if minutes is not None else None) == 0
    except (subprocess.TimeoutExpired, KeyboardInterrupt):
        print("\nstopped; the next run tests the remaining mutants", flush=True)
        process.send_signal(signal.SIGINT)
        try:
            process.wait(_END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        return True


def hung(mutants: list[Mutant]) -> list[str]:
    """Return the names of mutants that timed out, perhaps only because the computer was slow."""
    return [one.name for one in mutants if one.status == "timeout"]


def summarise(mutants: list[Mutant], explained: Explained, *, is_part: bool) -> int:
    """Print one line per module, then each unexplained surviving mutant."""
    print("\n".join(table(mutants, explained)))
    lives = [one for one in mutants if one.status not in (*DEAD, "waiting")]
    new = [one for one in lives if not explained.covers(one)]
    for one in new:
        print(f"\n{one.status}: {one.name}\n{one.shown}")
    for entry in explained.unused(mutants):
        print(f"\n{EXPLAINED.name}: no surviving mutant matches this explanation: {entry}")
    killed = sum(one.status in DEAD for one in mutants)
    waiting = sum(one.status == "waiting" for one in mutants)
    print(f"\n{len(new)} surviving mutants are not explained")
    if waiting:
        print(f"{waiting} mutants are untested: run ./dev mutate again")
        return UNFINISHED
    return 0 if not new and (is_part or killed >= WANTED * len(mutants)) else 1


if __name__ == "__main__":
    sys.exit(main())

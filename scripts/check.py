"""The command `./dev test`: run lint, type checks and all tests, then print a summary.

`./dev test quick` skips the tests with real servers and browsers, and needs only Node. The quick
steps run in parallel, before all other steps. The motion tests leave most of the processors idle,
so they run in parallel with the other end-to-end tests. A failed step does not stop later steps.
The exit code is 0 if all steps pass, otherwise 1. If a required program is missing, its tests are
skipped and listed; with ``CI=true``, a skipped test is a failure.
"""

import asyncio
import hashlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from typing import IO

from hatch_build import NPM_TIMEOUT_S, VendorError, npm_command
from scripts.needs import NEEDS, Brought, bring
from scripts.node import node_executable
from scripts.site import HTML

ROOT = Path(__file__).resolve().parents[1]
PYTHON = sys.executable
NODE_MODULES = ROOT / "node_modules"
BUILT_SITE = "URC_BUILT_SITE"
"""Environment variable with the folder of the built site; without it, the tests build the site."""
PROCESSORS = os.cpu_count() or 1
HANGS_AFTER_S = 3600
"""Timeout for a step, in seconds, with a wide margin for slow computers."""


@dataclass(frozen=True, slots=True)
class Step:
    """A step of `./dev test`: a program that must exit with 0."""

    name: str
    command: tuple[str, ...]
    timeout_s: float = HANGS_AFTER_S
    is_yielding: bool = False
    """Whether the step runs at low priority, so that it does not delay steps that measure times."""
    is_measuring: bool = False
    """Whether the step measures times; if so, its session has priority over all other sessions."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of a step: its failure, its duration and its failed tests."""

    name: str
    fault: str
    """Reason for the failure; "" if the step passed."""
    seconds: float
    failed_tests: tuple[str, ...] = ()
    """pytest's summary line for each failed test, which contains the test's name and error."""


STATIC = (
    Step("lint", (PYTHON, "-m", "ruff", "check", ".")),
    Step("prose", (PYTHON, "-m", "scripts.prose")),
    Step("format", (PYTHON, "-m", "ruff", "format", "--check", ".")),
    # The step `site` checks all other links.
    Step("docs", (PYTHON, "-m", "scripts.docs", "--links")),
)
PYTEST = (PYTHON, "-m", "pytest")
PYTEST_COLUMNS = "250"
"""Width of pytest's output, in characters; pytest cuts a failed test's error to this width."""


_HALF_OF_UNIT = (
    *("runtime", "access", "protocol", "guard", "packages", "simulator", "config", "motion"),
)
# These processes do not communicate. A process that distributes thousands of small tests would use
# a fifth of the processor time. The longest steps start first, so that few are still running at the
# end.
QUICK = (
    Step("tests contract", (*PYTEST, "tests/contract")),
    Step(
        "tests unit 1",
        (*PYTEST, "tests/unit", *(f"--ignore=tests/unit/{one}" for one in _HALF_OF_UNIT)),
    ),
    Step("types", (PYTHON, "-m", "mypy")),
    Step("tests unit 2", (*PYTEST, *(f"tests/unit/{one}" for one in _HALF_OF_UNIT))),
)
QUICK_NEEDS = tuple(need for need in NEEDS if need.name == "node")
SLOW = (
    (
        # The build uses all processors; the site's tests need its result.
        Step("site", (PYTHON, "-m", "scripts.site"), is_yielding=True),
        # Most of these tests wait for a server or for silence, so a few in parallel need no more
        # processor time.
        Step(
            "tests e2e",
            (
                *(*PYTEST, "tests/e2e", "-m", "not alone"),
                *("-n", "3", "--dist", "loadgroup"),
            ),
            is_yielding=True,
        ),
    ),
    # These tests measure the time until a robot stops, and the rig has one set of addresses.
    (Step("tests motion", (*PYTEST, "tests/e2e", "-m", "alone"), is_measuring=True),),
)
"""Sequences of steps; the sequences run in parallel, the steps of a sequence one after another."""


def main() -> int:
    """Run every step, print the summary, and return the exit code."""
    if sys.argv[1:] not in ([], ["quick"]):
        print("usage: ./dev test [quick]", file=sys.stderr)
        return 2
    is_quick = bool(sys.argv[1:])
    start = time.monotonic()
    outcomes: list[Outcome] = []
    brought = bring(QUICK_NEEDS if is_quick else NEEDS)
    javascript, not_checked = javascript_step()
    brought.look_again()  # npm also installs a language server
    environment = os.environ | brought.environment
    # Hundreds of tests start Python; without cached bytecode, each start compiles all of URC.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    environment[BUILT_SITE] = str(HTML)
    quick = (*QUICK, *([javascript] if javascript else []), *STATIC)
    try:
        # Run twice as many steps as processors, because the unit tests spend a quarter of their
        # time waiting.
        outcomes += run([(step,) for step in quick], environment, at_once=2 * PROCESSORS)
        if not is_quick:
            names = ", ".join(step.name for steps in SLOW for step in steps)
            print(f"\n== running; each step's output appears when it ends: {names}", flush=True)
            outcomes += run(SLOW, environment)
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        return 1
    return summarise(outcomes, brought, not_checked, time.monotonic() - start)


def javascript_step() -> tuple[Step | None, str]:
    """Return the step that type-checks URC's JavaScript, or None and why it can't run."""
    node = node_executable()
    if node is None:
        return None, "JavaScript type check: Node is missing"
    try:
        install_checkers()
    except VendorError as error:
        return None, f"JavaScript type check: {error}"
    compiler = NODE_MODULES / "typescript" / "bin" / "tsc"
    return Step("javascript", (node, str(compiler), "--project", "tsconfig.json")), ""


def install_checkers() -> None:
    """Update node_modules to match the lock file; do nothing if it is up to date."""
    lock = hashlib.sha256((ROOT / "package-lock.json").read_bytes()).hexdigest()
    stamp = NODE_MODULES / ".urc-lock"
    if stamp.is_file() and stamp.read_text("utf-8") == lock:
        return
    print("installing the JavaScript checker ...", flush=True)
    command = [*npm_command(), "ci", "--ignore-scripts"]
    try:
        done = subprocess.run(
            command, cwd=ROOT, capture_output=True, text=True, timeout=NPM_TIMEOUT_S, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise VendorError(f"npm did not finish within {NPM_TIMEOUT_S} s") from error
    if done.returncode != 0:
        raise VendorError(f"npm failed: {done.stderr.strip()}")
    stamp.write_text(lock, encoding="utf-8")


def run(
    sequences: Sequence[Sequence[Step]],
    environment: Mapping[str, str],
    at_once: int = PROCESSORS,
) -> list[Outcome]:
    """Run sequences of steps, at most `at_once` in parallel; kill all processes left by the steps.

    Each step shows its output when it ends.
    """
    return asyncio.run(_run_all(sequences, environment, at_once))


async def _run_all(
    sequences: Sequence[Sequence[Step]], environment: Mapping[str, str], at_once: int
) -> list[Outcome]:
    free = asyncio.Semaphore(at_once)

    async def in_turn(steps: Sequence[Step]) -> list[Outcome]:
        async with free:
            return [await _shown(step, environment) for step in steps]

    async with asyncio.TaskGroup() as group:  # after an interrupt, it waits for the end of each
        tasks = [group.create_task(in_turn(steps)) for steps in sequences]
    return [outcome for task in tasks for outcome in task.result()]


async def _shown(step: Step, environment: Mapping[str, str]) -> Outcome:
    """Run a step, then show its output; collect the names of its failed tests."""
    # pytest also removes the folders of earlier runs. Two processes at once would disturb each
    # other, so each step has a root of its own.
    with (
        TemporaryDirectory(prefix="urc-", ignore_cleanup_errors=True) as root,
        TemporaryFile() as output,
    ):
        of_pytest = {"PYTEST_DEBUG_TEMPROOT": root, "COLUMNS": PYTEST_COLUMNS}
        outcome = await _run(step, {**environment, **of_pytest}, output)
        output.seek(0)
        said = output.read().decode("utf-8", "replace")
    print(f"\n== {step.name}\n{said}", end="", flush=True)
    if not outcome.fault:
        return outcome
    failed = [line for line in said.splitlines() if line.startswith(("FAILED ", "ERROR "))]
    return replace(outcome, failed_tests=tuple(failed))


async def _run(step: Step, environment: Mapping[str, str], output: IO[bytes]) -> Outcome:
    """Run a step; `output` receives its standard output and standard error."""
    start = time.monotonic()
    # Start a separate session, so that the processes of a killed test can also be ended.
    process = await asyncio.create_subprocess_exec(
        *step.command,
        cwd=ROOT,
        env=dict(environment),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=output,
        stderr=output,
        start_new_session=os.name != "nt",
    )
    _set_priority(process.pid, step)
    try:
        async with asyncio.timeout(step.timeout_s):
            code = await process.wait()
        fault = f"exit code {code}" if code else ""
    except TimeoutError:
        fault = f"not finished within {step.timeout_s:.0f} s"
    finally:
        await _end_group(process)
    return Outcome(step.name, fault, time.monotonic() - start)


def _set_priority(process: int, step: Step) -> None:
    """Set the priority of a step's process and session, as far as the system permits."""
    if step.is_yielding:
        with suppress(AttributeError, OSError):
            os.setpriority(os.PRIO_PROCESS, process, 10)
    # Linux may divide the processors among sessions first, whatever the priority of a process. The
    # other tests have a session for each browser, so one session comes before all others instead.
    if step.is_measuring:
        with suppress(OSError):
            Path(f"/proc/{process}/autogroup").write_text("-10", "ascii")


async def _end_group(process: asyncio.subprocess.Process) -> None:
    """Kill all processes that the step has left running."""
    with suppress(ProcessLookupError, PermissionError):  # usually no process is left
        if os.name == "nt":
            process.kill()
        else:
            os.killpg(process.pid, signal.SIGKILL)
    await process.wait()


def summarise(outcomes: list[Outcome], brought: Brought, not_checked: str, seconds: float) -> int:
    """Print a line for each step, the skipped and failed tests, and the result.

    The failed tests are at the end, because many logs contain only the last lines of a run.
    Return the exit code.
    """
    print(f"\n== summary, after {seconds:.0f} s", flush=True)
    for outcome in outcomes:
        word = "FAILED" if outcome.fault else "ok"
        print(f"{word:>8}  {outcome.name:<16} {outcome.seconds:6.1f} s  {outcome.fault}".rstrip())
    left_out = [f"{need.purpose}: no {need.name}" for need in brought.left_out]
    left_out += [not_checked] if not_checked else []
    for text in left_out:
        print(f"LEFT OUT  {text}")
    if brought.left_out:
        print(f"          to install: {brought.remedy}")
    failed = [outcome.name for outcome in outcomes if outcome.fault]
    for outcome in outcomes:
        for line in outcome.failed_tests:
            print(line)
    if failed:
        print(f"{len(failed)} of {len(outcomes)} steps failed: {', '.join(failed)}")
        return 1
    if left_out and os.environ.get("CI") == "true":
        print("all executed steps passed, but with CI=true no test may be skipped")
        return 1
    print("all passed" if not left_out else "all executed steps passed")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""The command `./dev test`: lint, types and every test, in a fixed order, with one summary.

`./dev test quick` leaves out the tests with real servers and browsers; it needs only Node. A failed
step does not stop later steps. Exit code 0 when all passed, 1 otherwise. A test without its program
is left out by name; with ``CI=true`` that is a failure.
"""

import hashlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO

from hatch_build import NPM_TIMEOUT_S, VendorError, npm_command
from scripts.needs import NEEDS, Brought, bring
from scripts.node import node_executable

ROOT = Path(__file__).resolve().parents[1]
PYTHON = sys.executable
NODE_MODULES = ROOT / "node_modules"


@dataclass(frozen=True, slots=True)
class Step:
    """A program that must exit with 0."""

    name: str
    command: tuple[str, ...]
    timeout_s: float = 120
    beside: tuple[str, ...] = ()
    """A second command to run at the same time; it must pass too, and its output comes last."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of a step."""

    name: str
    fault: str
    """Empty after a pass."""
    seconds: float


STATIC = (
    Step("lint", (PYTHON, "-m", "ruff", "check", ".")),
    Step("prose", (PYTHON, "-m", "scripts.prose")),
    Step("format", (PYTHON, "-m", "ruff", "format", "--check", ".")),
    Step("types", (PYTHON, "-m", "mypy"), timeout_s=300),
    Step("docs", (PYTHON, "-m", "scripts.docs")),
)
PYTEST = (PYTHON, "-m", "pytest")


def halves(tests: str, *half: str, timeout_s: float) -> Step:
    """Return a step that runs the folders `half` of `tests`, in parallel with all other tests.

    The processes of these two groups do not communicate. A third one that distributed thousands of
    small tests would need a fifth of the processors.
    """
    half = tuple(f"{tests}/{name}" for name in half)
    others = (*PYTEST, tests, *(f"--ignore={path}" for path in half))
    name = f"tests {tests.rpartition('/')[2]}"
    return Step(name, (*PYTEST, *half), timeout_s, beside=others)


QUICK = (
    halves(
        "tests/unit",
        *("protocol", "runtime", "guard", "simulator", "motion", "config"),
        timeout_s=240,
    ),
    halves(
        "tests/contract",
        *("test_robots.py", "test_protocols.py", "test_worlds.py"),
        *("test_schemas.py", "test_codes.py", "test_house.py"),
        timeout_s=420,
    ),
)
QUICK_NEEDS = tuple(need for need in NEEDS if need.name == "node")
TESTS = (
    *QUICK,
    # Most of them wait for a server or for silence, so a few in parallel need no more processor.
    Step(
        "tests e2e",
        (
            *(*PYTEST, "tests/e2e", "-m", "not alone"),
            *("-n", "3", "--dist", "loadgroup"),
        ),
        timeout_s=900,
    ),
    # They measure the time until a robot stops.
    Step("tests motion", (*PYTEST, "tests/e2e/motion", "-m", "alone"), timeout_s=420),
)


def main() -> int:
    """Run every step; print the summary; return the exit code."""
    if sys.argv[1:] not in ([], ["quick"]):
        print("usage: ./dev test [quick]", file=sys.stderr)
        return 2
    is_quick = bool(sys.argv[1:])
    outcomes: list[Outcome] = []
    brought = bring(QUICK_NEEDS if is_quick else NEEDS)
    javascript, not_checked = javascript_step()
    brought.look_again()  # npm also installs a language server
    environment = os.environ | brought.environment
    steps = (*STATIC, *([javascript] if javascript else []), *(QUICK if is_quick else TESTS))
    try:
        for step in steps:
            outcomes.append(run(step, environment))
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        return 1
    return summarise(outcomes, brought, not_checked)


def javascript_step() -> tuple[Step | None, str]:
    """Return the type check of URC's JavaScript, or None and the reason why it cannot run."""
    node = node_executable()
    if node is None:
        return None, "the type check of the JavaScript: no Node"
    try:
        install_checkers()
    except VendorError as error:
        return None, f"the type check of the JavaScript: {error}"
    compiler = NODE_MODULES / "typescript" / "bin" / "tsc"
    return Step("javascript", (node, str(compiler), "--project", "tsconfig.json")), ""


def install_checkers() -> None:
    """Update node_modules to the lock file; do nothing if it is up to date."""
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
        raise VendorError(f"npm gave no answer within {NPM_TIMEOUT_S} s") from error
    if done.returncode != 0:
        raise VendorError(f"npm failed: {done.stderr.strip()}")
    stamp.write_text(lock, encoding="utf-8")


def run(step: Step, environment: Mapping[str, str]) -> Outcome:
    """Run one step with its output shown at once, and end all processes that it started."""
    print(f"\n== {step.name}", flush=True)
    start = time.monotonic()
    fault = ""
    with ExitStack() as started:
        processes = [started.enter_context(running(step.command, environment))]
        if step.beside:
            said = started.enter_context(shown_at_the_end())
            processes.append(started.enter_context(running(step.beside, environment, said)))
        try:
            for process in processes:
                code = process.wait(max(0.0, start + step.timeout_s - time.monotonic()))
                fault = fault or (f"exit code {code}" if code else "")
        except subprocess.TimeoutExpired:
            fault = f"not done within {step.timeout_s:.0f} s"
    return Outcome(step.name, fault, time.monotonic() - start)


@contextmanager
def running(
    command: tuple[str, ...], environment: Mapping[str, str], output: IO[bytes] | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    """Start a program, and end it with all its children; `output` replaces standard output."""
    # A session of its own, so that processes of a killed test can be ended too.
    process = subprocess.Popen(
        command,
        cwd=ROOT,
        env=dict(environment),
        stdin=subprocess.DEVNULL,
        stdout=output,
        stderr=output,
        start_new_session=os.name != "nt",
    )
    try:
        yield process
    finally:
        end_group(process)


@contextmanager
def shown_at_the_end() -> Iterator[IO[bytes]]:
    """Yield a file to write to, and print its content at the end."""
    with TemporaryFile() as said:
        try:
            yield said
        finally:
            said.seek(0)
            print(said.read().decode("utf-8", "replace"), flush=True)


def end_group(process: subprocess.Popen[bytes]) -> None:
    """Kill all processes that the step left running."""
    if os.name == "nt":
        process.kill()
    else:
        with suppress(ProcessLookupError, PermissionError):  # usually no process is left
            os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def summarise(outcomes: list[Outcome], brought: Brought, not_checked: str) -> int:
    """Print a line for each step, then the left-out tests and the result; return the exit code."""
    print("\n== summary", flush=True)
    for outcome in outcomes:
        word = "FAILED" if outcome.fault else "ok"
        print(f"{word:>8}  {outcome.name:<12} {outcome.seconds:6.1f} s  {outcome.fault}".rstrip())
    left_out = [f"{need.purpose}: no {need.name}" for need in brought.left_out]
    left_out += [not_checked] if not_checked else []
    for text in left_out:
        print(f"LEFT OUT  {text}")
    if brought.left_out:
        print(f"          to install it: {brought.remedy}")
    failed = [outcome.name for outcome in outcomes if outcome.fault]
    if failed:
        print(f"{len(failed)} of {len(outcomes)} steps failed: {', '.join(failed)}")
        return 1
    if left_out and os.environ.get("CI") == "true":
        print("all that ran passed, but with CI=true nothing may be left out")
        return 1
    print("all passed" if not left_out else "all that ran passed")
    return 0


if __name__ == "__main__":
    sys.exit(main())

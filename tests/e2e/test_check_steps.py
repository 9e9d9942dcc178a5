"""The steps of `./dev test` as processes: how they end, and that nothing outlives them."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from scripts.check import TESTS, Step, run
from tests.e2e.together import TOGETHER

HERE = Path(__file__).parent

SLEEP = "import time; time.sleep(60)"

# Takes a lock, hands it to a child that would stay, and goes on as told.
WITH_CHILD = f"""
import fcntl, subprocess, sys
lock = open(sys.argv[1], "w")
fcntl.flock(lock, fcntl.LOCK_EX)
subprocess.Popen([sys.executable, "-c", {SLEEP!r}], pass_fds=[lock.fileno()])
"""
RELEASE_TIMEOUT_S = 10


@pytest.mark.parametrize(
    ("program", "timeout_s", "fault"),
    [
        ("", 30, ""),
        ("raise SystemExit(3)", 30, "exit code 3"),
        (SLEEP, 0.2, "not done within 0 s"),
    ],
)
def test_a_step_ends_well_or_says_how(program: str, timeout_s: float, fault: str) -> None:
    """Exit code 0 is the only success; a hang is a failure too."""
    step = Step("step", (sys.executable, "-c", program), timeout_s)
    assert run(step, os.environ).fault == fault


@pytest.mark.parametrize(
    ("here", "beside", "timeout_s", "fault"),
    [
        ("", "", 30, ""),
        ("raise SystemExit(3)", "", 30, "exit code 3"),
        ("", "raise SystemExit(4)", 30, "exit code 4"),
        ("", SLEEP, 5, "not done within 5 s"),
    ],
)
def test_both_commands_of_a_step_must_end_well(
    capfd: pytest.CaptureFixture[str], here: str, beside: str, timeout_s: float, fault: str
) -> None:
    """What the second says is shown, whole and after the first, however it ends."""
    say = "print('I am {}', flush=True);"
    first, second = (
        (sys.executable, "-c", say.format("first") + here),
        say.format("second") + beside,
    )
    step = Step("step", first, timeout_s, beside=(sys.executable, "-c", second))
    assert run(step, os.environ).fault == fault
    assert capfd.readouterr().out.split("\n")[:4] == ["", "== step", "I am first", "I am second"]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no process groups to end")
@pytest.mark.parametrize("ending", ["", SLEEP])
def test_nothing_outlives_a_step(tmp_path: Path, ending: str) -> None:
    """A test that is killed leaves no server behind, nor does one that forgets it."""
    import fcntl  # not on Windows

    step = Step("step", (sys.executable, "-c", WITH_CHILD + ending, str(tmp_path / "lock")), 3)
    run(step, os.environ)
    with (tmp_path / "lock").open() as lock:
        deadline = time.monotonic() + RELEASE_TIMEOUT_S
        while True:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return
            except BlockingIOError:
                assert time.monotonic() < deadline, "the child of the step still lives"
                time.sleep(0.05)


def test_modules_that_belong_together_are_run_by_one_process() -> None:
    """As the step says it; a group that nobody keeps is a fault that shows now and then only."""
    assert sorted(TOGETHER) == sorted({file.stem for file in HERE.rglob("*.py")} & {*TOGETHER})
    (command,) = (step.command for step in TESTS if "loadgroup" in step.command)
    several = command[command.index("-n") :]
    done = subprocess.run(
        [*command[:3], str(HERE / "test_editor.py"), "-k", "shipped", "-v", *several],
        cwd=HERE.parents[1], capture_output=True, text=True, timeout=100, check=True,
    )  # fmt: skip
    ran = re.findall(r"^\[(gw\d+)\].* PASSED", done.stdout, re.MULTILINE)
    assert len(ran) > 2
    assert len(set(ran)) == 1

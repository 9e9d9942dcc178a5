"""The steps of `./dev test` as processes: how they end, and that nothing outlives them."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from threading import Timer

import pytest

from scripts.check import SLOW, Step, run
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

SESSION_PRIORITY = Path("/proc/self/autogroup")
# The priority is set after the start of the step.
SHOWS_PRIORITY = f"""
import time
end_s = time.monotonic() + 5
while "-10" not in (text := open({str(SESSION_PRIORITY)!r}).read()) and time.monotonic() < end_s:
    time.sleep(0.02)
print(text, end="")
"""


@pytest.mark.parametrize(
    ("program", "timeout_s", "fault"),
    [
        ("", 30, ""),
        ("raise SystemExit(3)", 30, "exit code 3"),
        (SLEEP, 0.2, "not finished within 0 s"),
    ],
)
def test_a_step_ends_well_or_says_how(program: str, timeout_s: float, fault: str) -> None:
    """Exit code 0 is the only success; a hang is a failure too."""
    step = Step("step", (sys.executable, "-c", program), timeout_s)
    assert [one.fault for one in run([[step]], os.environ)] == [fault]


def test_steps_in_parallel_have_their_own_faults_and_outputs(
    capfd: pytest.CaptureFixture[str],
) -> None:
    """A failed step ends neither the next one of its sequence nor any other; each shows all."""
    say = "import sys, time; print('I am', flush=True); time.sleep(0.5);"
    ends = ["", "print('late', file=sys.stderr); raise SystemExit(3)", SLEEP, ""]
    faults = ["", "exit code 3", "not finished within 5 s", ""]
    steps = [
        Step(f"step {place}", (sys.executable, "-c", say + end), 5)
        for place, end in enumerate(ends)
    ]
    outcomes = run([steps[:2], *([step] for step in steps[2:])], os.environ)
    assert [(one.name, one.fault) for one in outcomes] == [
        (step.name, fault) for step, fault in zip(steps, faults, strict=True)
    ]
    shown = capfd.readouterr().out.split("\n== ")
    assert sorted(shown) == [
        "",
        "step 0\nI am\n",
        "step 1\nI am\nlate\n",
        "step 2\nI am\n",
        "step 3\nI am\n",
    ]


def test_a_failed_step_lists_its_failed_tests(tmp_path: Path) -> None:
    """The names come from the output of pytest; a step that passes lists none."""
    module = tmp_path / "test_sums.py"
    module.write_text(
        "def test_wrong(): assert 1 + 1 == 3\n"
        "def test_right(): print('FAILED to fail'); assert 1 + 1 == 2\n"
    )
    command = (sys.executable, "-m", "pytest", "-rA", "-p", "no:cacheprovider", str(module))
    wrong, right = run(
        [[Step(name, (*command, "-k", name))] for name in ("wrong", "right")], os.environ
    )
    assert [line.split("::")[1] for line in wrong.failed_tests] == [
        "test_wrong - assert (1 + 1) == 3"
    ]
    assert right.failed_tests == ()


def test_steps_in_parallel_share_no_temporary_folder_of_pytest(
    capfd: pytest.CaptureFixture[str],
) -> None:
    """Two processes of pytest that remove the same old folder disturb each other."""
    say = "import os; print(os.environ['PYTEST_DEBUG_TEMPROOT'])"
    run([[Step(f"step {place}", (sys.executable, "-c", say))] for place in range(2)], os.environ)
    folders = [part.splitlines()[1] for part in capfd.readouterr().out.split("\n== ")[1:]]
    assert len(set(folders)) == 2
    assert not [folder for folder in folders if Path(folder).exists()]


@pytest.mark.skipif(
    not SESSION_PRIORITY.exists(), reason="the system does not divide processors among sessions"
)
def test_the_session_of_a_measuring_step_comes_first(capfd: pytest.CaptureFixture[str]) -> None:
    """As far as the user may raise a priority, which `nice` complains of otherwise."""
    nice = subprocess.run(["nice", "-n", "-10", "true"], capture_output=True, check=True)
    priority = "0" if nice.stderr else "-10"
    run([[Step("step", (sys.executable, "-c", SHOWS_PRIORITY), is_measuring=True)]], os.environ)
    assert capfd.readouterr().out.endswith(f" nice {priority}\n")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signal")
def test_an_interrupt_ends_all_steps() -> None:
    """No step that waits for its turn is started."""
    steps = [Step(f"step {place}", (sys.executable, "-c", SLEEP)) for place in range(20)]
    interrupt = Timer(1.0, os.kill, (os.getpid(), signal.SIGINT))
    interrupt.start()
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        run([steps[:10], *([step] for step in steps[10:])], os.environ)
    interrupt.join()
    assert time.monotonic() - start < 30


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no process groups to end")
@pytest.mark.parametrize("ending", ["", SLEEP])
def test_nothing_outlives_a_step(tmp_path: Path, ending: str) -> None:
    """A test that is killed leaves no server behind, nor does one that forgets it."""
    import fcntl  # not on Windows

    step = Step("step", (sys.executable, "-c", WITH_CHILD + ending, str(tmp_path / "lock")), 3)
    run([[step]], os.environ)
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
    command = next(step.command for steps in SLOW for step in steps if "loadgroup" in step.command)
    several = command[command.index("-n") :]
    done = subprocess.run(
        [*command[:3], str(HERE / "test_editor.py"), "-k", "shipped", "-v", *several],
        cwd=HERE.parents[1], env=os.environ | {"URC_THOROUGH": "1"},
        capture_output=True, text=True, timeout=200, check=True,
    )  # fmt: skip
    ran = re.findall(r"^\[(gw\d+)\].* PASSED", done.stdout, re.MULTILINE)
    assert len(ran) > 2
    assert len(set(ran)) == 1

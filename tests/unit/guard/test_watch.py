"""Whether a guard that says nothing hangs, or only has no time to run."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from urc.guard import messages, pipe_channel
from urc.guard.guard_client import GuardClient
from urc.guard.pipe_channel import PipeChannel
from urc.guard.process import ProcessState, standing


class FakePipe:
    """A pipe on which nothing comes."""

    is_closed = False
    taken_bytes = 0

    def close(self) -> None:
        """Close."""
        self.is_closed = True


class Watched(PipeChannel):
    """A channel of whose process only the standing is known."""

    def __init__(self) -> None:
        super().__init__(GuardClient([], {}, PipeChannel))
        self._pipe = self.pipe = FakePipe()  # type: ignore[assignment]
        self._was_heard = True
        self.deaths = 0

    def looks(self, count: int) -> None:
        """Look so often, each time in time."""
        for _ in range(count):
            if self.pipe.is_closed:
                return
            self._look_s = float("inf")
            self._watch()
            assert self._look is not None
            self._look.cancel()

    def _died(self) -> None:
        self.deaths += 1


@pytest.fixture
def stands(monkeypatch: pytest.MonkeyPatch) -> list[ProcessState]:
    """How the process stands: what was put here last."""
    said = [ProcessState()]
    monkeypatch.setattr(
        pipe_channel, "standing", lambda pid: said[-1] if pid == 0 else ProcessState()
    )
    return said


@pytest.mark.anyio
async def test_one_that_is_silent_for_half_a_second_has_hung(stands: list[ProcessState]) -> None:
    """It sleeps, was stopped, or runs in a circle: whoever could speak does."""
    for standing_ in (ProcessState(), ProcessState(wants_to_run=False, ran_s=7.0)):
        stands.append(standing_)
        guard = Watched()
        guard.looks(5)
        assert guard.deaths == 0
        guard.looks(1)
        assert guard.deaths == 1
    guard = Watched()
    for number in range(6):
        stands.append(ProcessState(wants_to_run=True, ran_s=1.0 + number * 0.1))
        guard.looks(1)
    assert guard.deaths == 1, "it had all the time there was"


@pytest.mark.anyio
async def test_one_that_is_let_run_by_nobody_is_waited_for(stands: list[ProcessState]) -> None:
    """Another one would get no more of the machine; but not for ever, and not after it spoke."""
    stands.append(ProcessState(wants_to_run=True, ran_s=3.0))
    guard = Watched()
    guard.looks(20)
    assert guard.deaths == 0
    guard.looks(1)
    assert guard.deaths == 1


@pytest.mark.anyio
async def test_one_that_runs_for_less_than_half_the_time_is_waited_for(
    stands: list[ProcessState],
) -> None:
    guard = Watched()
    for number in range(10):
        stands.append(ProcessState(wants_to_run=True, ran_s=number * 0.4 * pipe_channel._LOOK_S))
        guard.looks(1)
    assert guard.deaths == 0


@pytest.mark.anyio
async def test_one_that_speaks_now_and_then_is_alive(stands: list[ProcessState]) -> None:
    guard = Watched()
    for _ in range(4):
        guard.looks(5)
        guard._handle(messages.Heartbeat(0.0))
    assert guard.deaths == 0


@pytest.mark.anyio
async def test_one_that_starts_has_ten_seconds(stands: list[ProcessState]) -> None:
    """Python may need this long to start."""
    guard = Watched()
    guard._was_heard = False
    guard.looks(100)
    assert guard.deaths == 0
    guard.looks(1)
    assert guard.deaths == 1


@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="the system tells nothing")
def test_a_process_tells_whether_it_would_run(tmp_path: Path) -> None:
    """Itself, one that was stopped, one that is gone, and a strange name that waits its turn."""
    assert standing(os.getpid()).wants_to_run
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as sleeper:
        try:
            os.kill(sleeper.pid, signal.SIGSTOP)
            os.waitpid(sleeper.pid, os.WUNTRACED)
            stopped = standing(sleeper.pid)
        finally:
            sleeper.kill()
    assert not stopped.wants_to_run
    assert stopped.ran_s > 0
    assert standing(sleeper.pid) == ProcessState()
    (tmp_path / "5").mkdir()
    (tmp_path / "5" / "stat").write_text("5 (a) S (b) R 1 2 3")
    (tmp_path / "5" / "schedstat").write_text("1500000000 2 3")
    assert standing(5, tmp_path) == ProcessState(wants_to_run=True, ran_s=1.5)
    (tmp_path / "5" / "stat").write_text("5 (gone) X 1 2 3")
    assert not standing(5, tmp_path).wants_to_run

"""The guard before everything ordinary: asked for, refused, given back after too long a run."""

import os
import signal
import sys

import pytest

from urc._environment import REAL_TIME
from urc.guard import real_time_priority
from urc.guard.real_time_priority import PAUSE_S, RealTimePriority, why_not

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="other systems have none of it")

RR, ORDINARY = "before the ordinary", "ordinary"


class System:
    """A kernel that does as told."""

    def __init__(self) -> None:
        self.refusal: OSError | None = None
        self.asked: list[str] = []
        self.bounds: tuple[int, int] | None = None
        self.now = 100.0
        self.handlers: dict[int, object] = {}

    def set(self, process: int, policy: int, parameter: os.sched_param) -> None:
        """Stand in for `os.sched_setscheduler`."""
        assert process == 0
        if self.refusal:
            raise self.refusal
        if policy == os.SCHED_OTHER:
            self.asked.append(ORDINARY)
        else:
            assert (policy, parameter.sched_priority) == (os.SCHED_RR | os.SCHED_RESET_ON_FORK, 1)
            self.asked.append(RR)

    def watch(self, number: int, handler: object) -> None:
        """Stand in for `signal.signal`."""
        self.handlers[number] = handler

    def bound(self, kind: int, bounds: tuple[int, int]) -> None:
        """Stand in for `resource.setrlimit`."""
        self.bounds = bounds


@pytest.fixture
def system(monkeypatch: pytest.MonkeyPatch) -> System:
    """Nothing of this process is changed."""
    made = System()
    monkeypatch.delenv(REAL_TIME, raising=False)
    monkeypatch.setattr(os, "sched_setscheduler", made.set)
    monkeypatch.setattr(real_time_priority.resource, "setrlimit", made.bound)
    monkeypatch.setattr(real_time_priority.time, "monotonic", lambda: made.now)
    monkeypatch.setattr(real_time_priority.signal, "signal", made.watch)
    return made


def test_it_is_asked_for_with_the_lowest_priority_and_bounds(system: System) -> None:
    """What it starts is ordinary; a run that does not end is ended by the kernel."""
    assert RealTimePriority().request() == ""
    assert system.asked == [RR]
    assert system.bounds == (100_000, 2_000_000)
    assert callable(system.handlers[signal.SIGXCPU])


def test_where_it_is_refused_nothing_else_happens(system: System) -> None:
    """The reason is the system's own, for people."""
    system.refusal = PermissionError(1, "Operation not permitted")
    asking = RealTimePriority()
    assert asking.request() == why_not() == "Operation not permitted"
    system.refusal = None
    asking.retry()
    assert (system.asked, system.bounds) == ([], None)


def test_it_is_not_asked_for_where_nobody_wants_it(
    system: System, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One word in the environment."""
    monkeypatch.setenv(REAL_TIME, "no")
    assert RealTimePriority().request() == why_not() == "URC_REAL_TIME is no"
    assert system.asked == []


def test_who_runs_too_long_is_ordinary_for_a_while(system: System) -> None:
    """A guard that is flooded must not keep everybody else from running."""
    asking = RealTimePriority()
    asking.request()
    asking._is_too_long(signal.SIGXCPU, None)
    asking.retry()
    assert system.asked == [RR, ORDINARY]
    system.now += PAUSE_S
    asking.retry()
    asking.retry()
    assert system.asked == [RR, ORDINARY, RR]


def test_asking_whether_it_would_be_given_keeps_nothing(system: System) -> None:
    """`urc doctor` stays an ordinary program."""
    assert why_not() == ""
    assert system.asked == [RR, ORDINARY]

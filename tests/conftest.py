"""What all tests share: one kind of event loop, a time-out, the rule for missing programs.

A test that needs a program beside Python says so with ``@pytest.mark.needs("netcat")``, a name of
the table in scripts/needs.py; one that uses a browser fixture needs a browser by that alone.
``./dev test`` names what it could not bring in ``URC_LEFT_OUT``; only then are those tests skipped,
and its summary lists them. With ``CI=true`` a run in which anything was skipped fails, except for
lack of a build (`NO_BUILD`).
"""

import asyncio
import gc
import os
import signal
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from inspect import iscoroutinefunction
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Any, Final

import pytest
from hypothesis import settings

from scripts.needs import NEEDS
from tests import open_databases
from tests.effort import examples, seed
from tests.sampling import left_out

# The tests must not read or change the data of their user, such as the latched STOP of a robot.
DATA = TemporaryDirectory(prefix="urc-data-", ignore_cleanup_errors=True)
os.environ["URC_DATA_DIR"] = DATA.name

# Python's own threshold checks all new objects 1,400 times while the tests are collected.
gc.set_threshold(200_000, 20, 50)

open_databases.watch()

# Properties that name no number of their own; a busy machine is no failure.
settings.register_profile("urc", max_examples=examples(100), deadline=None)
settings.load_profile("urc")

PROGRAMS = {need.name: need for need in NEEDS}
BROWSERS = {"browser": ("headless-shell", "chromium"), "whole_browser": ("chromium",)}
"""Fixture → the programs that it starts: the first that is there."""

# Well below the limit in pyproject.toml, which ends the whole run: here only the one test fails.
TEST_TIMEOUT_S = int(os.environ.get("URC_TEST_TIMEOUT_S", "120"))


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let tests that compare pictures take them anew."""
    parser.addoption("--update", action="store_true", help="take the kept pictures anew")


def pytest_report_header() -> str:
    """Name the seed of `tests.effort.sampled`."""
    return f"samples: URC_TEST_SEED={seed()}"


@pytest.fixture(scope="session")
def anyio_backend() -> str:
    """Run async tests on asyncio only, all in one loop, so that a session can own a browser."""
    return "asyncio"


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> Iterator[None]:
    """Give every test a time-out of its own."""
    if iscoroutinefunction(pyfuncitem.obj):
        pyfuncitem.obj = bounded(pyfuncitem.obj)
        return (yield)
    with alarm(TEST_TIMEOUT_S):
        return (yield)


def bounded(test: Callable[..., Awaitable[None]]) -> Callable[..., Awaitable[None]]:
    """Cancel an async test that takes too long, so that its fixtures are still taken down."""

    @wraps(test)
    async def run(*args: Any, **kwargs: Any) -> None:
        async with asyncio.timeout(TEST_TIMEOUT_S):
            await test(*args, **kwargs)

    return run


@contextmanager
def alarm(seconds: float) -> Iterator[None]:
    """Raise TimeoutError in the main thread after `seconds`, on systems that have the signal."""
    if not hasattr(signal, "SIGALRM"):
        yield
        return

    def ring(number: int, frame: FrameType | None) -> None:
        raise TimeoutError(f"the test took longer than {seconds} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def needs_of(item: pytest.Item) -> set[str]:
    """Return the names of the programs that the test needs."""
    named = {str(mark.args[0]) for mark in item.iter_markers("needs")}
    browsers = [BROWSERS[name] for name in getattr(item, "fixturenames", ()) if name in BROWSERS]
    found = [[name for name in names if PROGRAMS[name].find()] or names for names in browsers]
    return named | {names[0] for names in found}


def pytest_collection_finish() -> None:
    """Exempt modules and tests from garbage collection; they exist until the end of the run."""
    open_databases.left_open(is_last=True)  # of modules, not of a test
    gc.freeze()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect the tests outside the sample, and skip tests whose programs are missing.

    A test that needs a program outside `scripts/needs.py` is a usage error.
    """
    is_named = any("::" in argument for argument in config.args)
    if not is_named and (deselected := left_out(items)):
        config.hook.pytest_deselected(items=list(deselected))
        items[:] = [item for item in items if item not in deselected]
    missing_here = set(os.environ.get("URC_LEFT_OUT", "").split(",")) - {""}
    for item in items:
        needs = needs_of(item)
        if unknown := needs - PROGRAMS.keys():
            raise pytest.UsageError(f"{item.nodeid} needs {unknown}, not in scripts/needs.py")
        if missing := needs & missing_here:
            item.add_marker(pytest.mark.skip(reason=f"left out: no {', '.join(sorted(missing))}"))


NO_BUILD: Final = "no build for this Python and processor"
"""Reason of tests whose package cannot be had for this computer at all."""


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Fail, not skip, when a program is missing and nobody said that it may be."""
    for name in sorted(needs_of(item)):
        if PROGRAMS[name].find() is None:
            pytest.fail(f"{name} is not installed; ./dev test brings it", pytrace=False)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[None]:
    """Fail a test that leaves a database open; in the e2e tests, the last test of a module."""
    result = yield
    is_last = nextitem is None or nextitem.path != item.path
    has_servers = "e2e" in item.path.parts  # their databases end with the module
    left = open_databases.left_open(is_last=is_last) if is_last or not has_servers else []
    if left:
        pytest.fail("left open: " + "; ".join(left), pytrace=False)
    return result


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """With CI=true, a skipped test is a failure of the whole run, unless nobody can run it here."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if reporter is None:
        return
    reports = reporter.stats.get("skipped", ())
    skipped = sum(NO_BUILD not in str(report.longrepr) for report in reports)
    if os.environ.get("CI") == "true" and skipped and exitstatus == 0:
        reporter.write_line(f"\nCI=true, and {skipped} tests were skipped", red=True)
        session.exitstatus = pytest.ExitCode.TESTS_FAILED

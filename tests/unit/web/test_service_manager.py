"""Messages to systemd: when there are any, and when the heartbeat stays away."""

import os

import anyio
import pytest

from urc.web.serve.service_manager import ServiceManager

pytestmark = pytest.mark.anyio


@pytest.mark.parametrize(
    ("environment", "watchdog_s"),
    [
        ({}, 0.0),
        ({"WATCHDOG_USEC": "3000000"}, 0.0),  # no place to tell it
        ({"NOTIFY_SOCKET": "relative", "WATCHDOG_USEC": "3000000"}, 0.0),
        ({"NOTIFY_SOCKET": "/nowhere"}, 0.0),
        ({"NOTIFY_SOCKET": "/nowhere", "WATCHDOG_USEC": "soon"}, 0.0),
        ({"NOTIFY_SOCKET": "@abstract", "WATCHDOG_USEC": "3000000"}, 3.0),
        ({"NOTIFY_SOCKET": "/nowhere", "WATCHDOG_USEC": "1", "WATCHDOG_PID": "1"}, 0.0),
        (
            {"NOTIFY_SOCKET": "/n", "WATCHDOG_USEC": "500000", "WATCHDOG_PID": str(os.getpid())},
            0.5,
        ),
    ],
)
def test_interval_of_the_watchdog(environment: dict[str, str], watchdog_s: float) -> None:
    """The variables are those of sd_watchdog_enabled(3)."""
    assert ServiceManager(environment).watchdog_s == watchdog_s


async def test_sick_server_gives_no_sign_of_life(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    answers = [True, False, False, True]
    manager = ServiceManager({"NOTIFY_SOCKET": "/nowhere", "WATCHDOG_USEC": "3000"})
    monkeypatch.setattr(manager, "tell", said.append)
    ended = anyio.Event()

    async def is_healthy(within_s: float) -> bool:
        assert within_s == pytest.approx(0.001)
        if not answers:
            ended.set()
            await anyio.sleep_forever()
        return answers.pop(0)

    async with anyio.create_task_group() as group:
        group.start_soon(manager.watch, is_healthy)
        await ended.wait()
        group.cancel_scope.cancel()
    assert said == ["WATCHDOG=1", "WATCHDOG=1"]


async def test_without_a_watchdog_nothing_is_watched() -> None:
    async def is_healthy(within_s: float) -> bool:
        raise AssertionError("nobody asked")

    await ServiceManager({}).watch(is_healthy)


def test_manager_that_does_not_listen_is_ignored(caplog: pytest.LogCaptureFixture) -> None:
    ServiceManager({"NOTIFY_SOCKET": "/nowhere/at/all"}).tell("READY=1")
    assert "cannot send messages to systemd" in caplog.text

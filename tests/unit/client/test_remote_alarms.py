"""The alarms of a program: changes of the server, and its own actions."""

from collections.abc import Mapping
from typing import Any

import pytest

from urc.client.remote_alarms import RemoteAlarms
from urc.problems import UrcError
from urc.wire.server_messages import AlarmRow, AlarmsMessage

pytestmark = pytest.mark.anyio


def row(
    signal: str, number: int, state: str = "unacknowledged", *, active: bool = True
) -> AlarmRow:
    return AlarmRow(signal, "low", "high", state, number, 1, 100 + number, 0, active=active)


class Server:
    """A server that records requests."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, Mapping[str, Any]]] = []
        self.answer: Mapping[str, Any] = {"signals": ["battery"], "stored": True}

    async def post(self, verb: str, body: Mapping[str, Any]) -> Mapping[str, Any]:
        self.asked.append((verb, body))
        return self.answer


@pytest.fixture
def server() -> Server:
    return Server()


@pytest.fixture
def alarms(server: Server) -> RemoteAlarms:
    made = RemoteAlarms(server.post)
    rows = [row("heat", 2), row("battery", 1), row("fan", 3, "shelved")]
    made.update(AlarmsMessage(0, [*rows, row("fix", 4, "returned", active=False)], full=True))
    return made


def test_the_list_follows_the_changes(alarms: RemoteAlarms) -> None:
    assert [one.signal for one in alarms.active] == ["battery", "heat"]
    alarms.update(AlarmsMessage(0, [row("mode", 5)], gone=("battery",), flood=True))
    assert [one.signal for one in alarms.active] == ["heat", "mode"]
    assert alarms.is_flooded
    alarms.update(AlarmsMessage(0, [row("heat", 2)], full=True))
    assert [*alarms.rows] == ["heat"]
    alarms.clear()
    assert (alarms.rows, alarms.is_flooded) == ({}, False)


async def test_a_program_acknowledges_what_it_knows(alarms: RemoteAlarms, server: Server) -> None:
    assert await alarms.acknowledge() == ("battery",)
    assert await alarms.acknowledge("heat", "unknown") == ("battery",)
    assert await alarms.acknowledge("unknown") == ()
    assert server.asked == [
        ("acknowledge", {"alarms": {"heat": 102, "battery": 101, "fix": 104}}),
        ("acknowledge", {"alarms": {"heat": 102}}),
    ]


async def test_a_shelf_has_an_end(alarms: RemoteAlarms, server: Server) -> None:
    await alarms.shelve("battery", "heat", for_s=600)
    await alarms.unshelve("battery")
    assert server.asked == [
        ("shelve", {"signals": ("battery", "heat"), "for_s": 600}),
        ("unshelve", {"signals": ("battery",)}),
    ]


async def test_an_unknown_answer_is_an_error(alarms: RemoteAlarms, server: Server) -> None:
    server.answer = {"done": True}
    with pytest.raises(UrcError, match="invalid response"):
        await alarms.unshelve("battery")

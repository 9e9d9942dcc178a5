"""The dialogue of an emulated robot with one client, without a connection."""

import asyncio
from collections.abc import Sequence

import pytest

from urc.model.payload import Payload
from urc.problems import UrcError
from urc.simulator.emulated_robot import EmulatedRobot
from urc.simulator.servers.base import ServerContext, option_port
from urc.simulator.servers.clients import ClientConnection, Clients, converse
from urc.testing.profile import QUESTION, line_profile

pytestmark = pytest.mark.anyio

ASK = f"{QUESTION}\n".encode()


def context(*, is_per_request: bool = False, **options: object) -> ServerContext:
    profile = line_profile(is_per_request=is_per_request)
    emulated_robot = EmulatedRobot(profile, {})
    spec = profile.driver.transports["wire"]
    return ServerContext(
        "wire", spec, options, "127.0.0.1", lambda: emulated_robot.line("wire"), lambda: 7.0
    )


class Client:
    """Says what the test tells it to, one thing after the other."""

    def __init__(self, *says: Payload | BaseException | None) -> None:
        self.says = list(says)
        self.heard: list[Payload] = []

    async def take(self) -> Payload | None:
        says = self.says.pop(0)
        if isinstance(says, BaseException):
            raise says
        return says

    async def put(self, said: Sequence[Payload]) -> None:
        self.heard += said


async def talk(where: ServerContext, client: Client) -> None:
    connection = ClientConnection(where.line(), lambda: None)
    async with asyncio.timeout(5):
        await converse(where, connection, client.take, client.put)


@pytest.mark.parametrize("end", [None, b""])
async def test_client_is_answered_until_it_ends(end: bytes | None) -> None:
    client = Client(ASK[:5], ASK[5:] + ASK, end)
    await talk(context(), client)
    assert client.heard == [b"7\n", b"7\n"]


async def test_robot_that_closes_answers_once() -> None:
    """What the client would have said next is not asked for."""
    client = Client(ASK + ASK, ASK)
    await talk(context(is_per_request=True), client)
    assert client.heard == [b"7\n"]
    assert client.says == [ASK]


async def test_client_that_the_system_gives_up_is_lost() -> None:
    """Its time-out is not the robot's own clock."""
    with pytest.raises(TimeoutError):
        await talk(context(), Client(ASK, TimeoutError(110, "Connection timed out")))


async def test_client_that_was_silent_for_longest_makes_room() -> None:
    """A new client is always admitted, and `close` disconnects all."""
    clients = Clients(context(), limit=2)
    cut: list[int] = []
    talking = [asyncio.Event() for _ in range(3)]

    def enter(number: int) -> None:
        async def stay(client: ClientConnection) -> None:
            client.active_s = float(number)
            talking[number].set()
            await asyncio.Event().wait()

        clients.admit(stay, lambda: cut.append(number))

    for number in range(3):
        enter(number)
        async with asyncio.timeout(5):
            await talking[number].wait()
    assert set(cut) == {0}
    assert len(clients.lines) == 2
    await clients.close()
    assert set(cut) == {0, 1, 2}
    assert clients.lines == []


@pytest.mark.parametrize("port", [None, "7000", True, -1, 65_536])
async def test_port_must_be_one(port: object) -> None:
    with pytest.raises(UrcError) as told:
        option_port(context(port=port))
    assert str(told.value) == f"transports.wire.port: {port!r} is not a port to listen on"
    assert option_port(context(port=7000)) == 7000
    assert option_port(context(port=port)._replace(is_anywhere=True)) == 0


async def test_port_that_is_left_out_is_the_usual_one() -> None:
    """As it is for the transport itself."""
    assert option_port(context(), default=9090) == 9090
    assert option_port(context(port=7000), default=9090) == 7000

"""A robot on TCP whose line the guard holds: Link must not notice the difference."""

from functools import partial

from tests.e2e.transports.peers.tcp import TcpPeer
from urc.guard import messages
from urc.guard.channel import GuardedLineSpec
from urc.guard.guard_client import GuardClient
from urc.guard.local_channel import LocalChannel
from urc.guard.pipe_channel import PipeChannel
from urc.runtime.clock import LoopClock
from urc.transports.base import Transport, TransportSetup
from urc.transports.tcp import from_setup

__all__ = ["GuardedPeer", "InnerPeer"]


class GuardedPeer(TcpPeer):
    """The line is in another process."""

    def __init__(self) -> None:
        super().__init__()
        self._client: GuardClient | None = None

    def client(self, lines: list[GuardedLineSpec]) -> GuardClient:
        """Return a guard of `lines`."""
        return GuardClient(lines, {}, PipeChannel)

    def transport(self) -> Transport:
        """Return a line that leads here."""
        options: dict[str, object] = {"host": "127.0.0.1", "port": self.port}
        make = messages.MakeTransport(
            "wire", "urc.transports.tcp:from_setup", options, [], "", 0.25, False
        )
        self._client = self.client(
            [GuardedLineSpec(make, from_setup(TransportSetup("wire", options)))]
        )
        self._client.start()
        return self._client.transports["wire"]

    async def stop(self) -> None:
        """End the guard, too."""
        if self._client is not None:
            await self._client.finish()
        await super().stop()


class InnerPeer(GuardedPeer):
    """The same lines, held by this process."""

    def client(self, lines: list[GuardedLineSpec]) -> GuardClient:
        """Return a guard of `lines`."""
        return GuardClient(lines, {}, partial(LocalChannel, lines=lines, clock=LoopClock()))

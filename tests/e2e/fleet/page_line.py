"""The socket of a page, without a browser: leases, ticks, STOP and resets as a page sends them."""

import asyncio
import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from tests.e2e.fleet.two_sites import WAIT_S, Site

__all__ = ["PageLine"]

TICK_S = 0.05


class PageLine:
    """A page's socket to a robot; its newest lease and heartbeat are kept."""

    def __init__(self, site: Site, robot: str) -> None:
        self._url = f"ws://127.0.0.1:{site.port}/ws?robot={robot}"
        self._key = site.key
        self.lease: dict[str, Any] = {}
        self.input: dict[str, int] | None = None
        """Age and permitted speed of the newest tick, from the newest heartbeat."""
        self.refusals: list[str] = []
        self.is_over = False
        self._beat = 0
        self._number = 0
        self._changed = asyncio.Event()

    async def __aenter__(self) -> "PageLine":
        """Open the socket, and wait for the lease."""
        headers = {"authorization": f"Bearer {self._key}"}
        async with asyncio.timeout(WAIT_S):
            self._line: ClientConnection = await connect(self._url, additional_headers=headers)
            self._reading = asyncio.create_task(self._read())
            await self.until(lambda lease: bool(lease))
        return self

    async def __aexit__(self, *_: object) -> None:
        """Close the socket."""
        self._reading.cancel()
        await asyncio.gather(self._reading, return_exceptions=True)
        with suppress(TimeoutError):
            async with asyncio.timeout(1):
                await self._line.close()

    @property
    def is_mine(self) -> bool:
        """Whether this page has the controls."""
        holder = self.lease.get("holder")
        return holder is not None and holder["id"] == self.lease["you"]

    async def _read(self) -> None:
        try:
            async for text in self._line:
                if isinstance(text, str):
                    self._take(json.loads(text))
                    self._changed.set()
        except ConnectionClosed:
            pass
        self.is_over = True
        self._changed.set()

    def _take(self, message: Mapping[str, Any]) -> None:
        if message["t"] == "lease":
            self.lease = dict(message)
        elif message["t"] == "beat":
            self._beat, self.input = message["n"], message.get("input")
        elif message["t"] == "refused":
            self.refusals.append(message["message"])

    async def say(self, kind: str, **more: object) -> None:
        """Send a message."""
        await self._line.send(json.dumps({"t": kind, **more}))

    async def drive(self, verb: str, **more: object) -> None:
        """Send a request about the controls."""
        await self.say("drive", verb=verb, **more)

    async def tick(self, speed: float) -> None:
        """Send one tick with the newest lease and heartbeat."""
        self._number += 1
        await self.say(
            "tick",
            command="drive",
            arguments={"speed": speed},
            epoch=self.lease["epoch"],
            number=self._number,
            echo=self._beat,
        )

    async def hold(self, speed: float) -> None:
        """Send ticks until cancelled, or until the socket closes."""
        with suppress(ConnectionClosed):
            while not self.is_over:
                await self.tick(speed)
                await asyncio.sleep(TICK_S)

    async def until(self, is_true: Callable[[dict[str, Any]], bool]) -> None:
        """Wait until `is_true` returns True for the lease."""
        async with asyncio.timeout(WAIT_S):
            while not is_true(self.lease):
                self._changed.clear()
                await self._changed.wait()

    async def until_refused(self, text: str) -> None:
        """Wait until a request is refused with `text`."""
        await self.until(lambda _: any(text in one for one in self.refusals))

"""Serial: the transport against serialx's own streams, both over socat's pseudo-terminal."""

import platform
import tempfile
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from serialx import open_serial_connection

from bench.harness import Result
from bench.wire import Wire, measured, of_transport, running
from urc.transports.serial import SerialTransport, Settings

__all__ = ["run"]


def run(*, full: bool = False) -> Sequence[Result]:
    """Measure the transport ``serial``."""
    with tempfile.TemporaryDirectory() as folder:
        port = Path(folder, "port")

        async def bare() -> Wire:
            reader, writer = await open_serial_connection(str(port), baudrate=115200)

            async def send(data: bytes) -> None:
                writer.write(data)
                await writer.drain()

            async def close() -> None:
                writer.close()
                await writer.wait_closed()

            return Wire(send, lambda: reader.read(65536), close)

        where = f"PTY,raw,echo=0,link={port}"
        with running("socat", where, "PIPE", is_ready=port.exists):
            return measured(
                "transport_serial",
                bare,
                lambda: of_transport(SerialTransport(str(port), Settings())),
                trips=1000,
                batches=40,
                batch=100,
                rounds=25 if full else 11,
                versions={"python": platform.python_version(), "serialx": version("serialx")},
            )

"""TCP: the transport against asyncio's own streams, bare and with TLS, both to socat's echo."""

import asyncio
import platform
import socket
import ssl
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from bench.harness import Result
from bench.wire import Wire, measured, of_transport, running
from urc.transports._tls import Tls
from urc.transports.tcp import TcpTransport

__all__ = ["run"]


def run(*, full: bool = False) -> Sequence[Result]:
    """Measure the transport ``tcp``, bare and with TLS."""
    rounds = 25 if full else 11
    port, secret_port = _free_port(), _free_port()
    with tempfile.TemporaryDirectory() as folder:
        pem = Path(folder, "robot.pem")
        _make_certificate(pem)
        where = f"TCP-LISTEN:{port},bind=127.0.0.1,reuseaddr,fork,nodelay"
        secret = f"OPENSSL-LISTEN:{secret_port},bind=127.0.0.1,reuseaddr,fork,nodelay"
        with (
            running("socat", where, "PIPE", is_ready=lambda: _is_taken(port)),
            running(
                "socat",
                f"{secret},cert={pem},verify=0",
                "PIPE",
                is_ready=lambda: _is_taken(secret_port),
            ),
        ):
            context = ssl.create_default_context(cafile=str(pem))
            tls = Tls.of("tcp", {"ca": str(pem)})
            return [
                *_compared("transport_tcp", port, None, None, rounds),
                *_compared("transport_tcp with TLS", secret_port, context, tls, rounds),
            ]


def _compared(
    name: str, port: int, context: ssl.SSLContext | None, tls: Tls | None, rounds: int
) -> Sequence[Result]:
    async def bare() -> Wire:
        reader, writer = await asyncio.open_connection("127.0.0.1", port, ssl=context)
        writer.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

        async def send(data: bytes) -> None:
            writer.write(data)
            await writer.drain()

        async def close() -> None:
            writer.transport.abort()
            await asyncio.sleep(0)

        return Wire(send, lambda: reader.read(65536), close)

    return measured(
        name,
        bare,
        lambda: of_transport(TcpTransport("127.0.0.1", port, tls=tls)),
        trips=2000,
        batches=40,
        batch=400,
        rounds=rounds,
        versions={"python": platform.python_version(), "openssl": ssl.OPENSSL_VERSION.split()[1]},
    )


def _make_certificate(file: Path) -> None:
    """Write a certificate for 127.0.0.1, signed by itself, and its key."""
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1",
         "-nodes", "-days", "2", "-subj", "/CN=robot", "-addext", "subjectAltName=IP:127.0.0.1",
         "-keyout", str(file), "-out", f"{file}.crt"],
        check=True, capture_output=True, timeout=30,
    )  # fmt: skip
    file.write_text(file.read_text("ascii") + Path(f"{file}.crt").read_text("ascii"), "ascii")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _is_taken(port: int) -> bool:
    """Look without calling."""
    return f":{port:04X} 00000000:0000 0A" in Path("/proc/net/tcp").read_text("ascii")

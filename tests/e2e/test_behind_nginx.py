"""URC behind a real nginx, with the configuration of docs/install/behind-nginx.md."""

import asyncio
import os
import re
import shutil
import socket
import ssl
import subprocess
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from tests.e2e.command_line import run
from tests.e2e.processes import UrcProcess

pytestmark = pytest.mark.anyio

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "install" / "behind-nginx.md"
NAME = "robots.example"


def configuration(folder: Path, port: int, behind: str) -> Path:
    """Write the configuration of the page, with the ports and files of the test."""
    block = re.search(r"^```nginx\n(.*?)^```", PAGE.read_text("utf-8"), re.M | re.S)
    assert block is not None
    text = block[1].replace("listen 443 ssl", f"listen 127.0.0.1:{port} ssl")
    text = text.replace("http://127.0.0.1:8080", behind)
    text = text.replace("/etc/ssl/robots.example.pem", str(folder / "cert.pem"))
    text = text.replace("/etc/ssl/private/robots.example.key", str(folder / "key.pem"))
    temporary = "".join(
        f"{kind}_temp_path {folder / kind};\n"
        for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    file = folder / "nginx.conf"
    head = f"pid {folder / 'pid'};\nerror_log {folder / 'error.log'};\ndaemon off;\n"
    user = "user root;\n" if os.geteuid() == 0 else ""
    body = f"events {{}}\nhttp {{\naccess_log off;\n{temporary}{text}}}\n"
    file.write_text(head + user + body, "utf-8")
    return file


@asynccontextmanager
async def nginx(file: Path, port: int) -> AsyncIterator[None]:
    """Run nginx until the context ends."""
    program = shutil.which("nginx") or "/usr/sbin/nginx"
    process = await asyncio.create_subprocess_exec(program, "-p", str(file.parent), "-c", str(file))
    try:
        async with asyncio.timeout(30):
            while True:
                try:
                    _, writer = await asyncio.open_connection("127.0.0.1", port)
                    writer.close()
                    break
                except OSError:
                    assert process.returncode is None, (file.parent / "error.log").read_text()
                    await asyncio.sleep(0.05)
        yield
    finally:
        process.terminate()
        await process.wait()


def make_certificate(folder: Path) -> ssl.SSLContext:
    """Make a certificate for the name, and return a client's context that trusts it."""
    command = ("openssl", "req", "-x509", "-nodes", "-newkey", "ec")
    curve = ("-pkeyopt", "ec_paramgen_curve:prime256v1", "-subj", f"/CN={NAME}")
    names = ("-addext", f"subjectAltName=DNS:{NAME}")
    files = ("-keyout", str(folder / "key.pem"), "-out", str(folder / "cert.pem"))
    subprocess.run((*command, *curve, *names, *files), check=True, capture_output=True)
    return ssl.create_default_context(cafile=str(folder / "cert.pem"))


@pytest.mark.needs("nginx")
@pytest.mark.needs("openssl")
async def test_pages_and_sockets_work_behind_nginx(
    urc_process: Callable[..., UrcProcess], tmp_path: Path
) -> None:
    """HTTPS for a program with a token, a WebSocket of its origin, and none of another origin."""
    trusted = make_certificate(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    public = f"{NAME}:{port}"
    data = ("--data-dir", str(tmp_path / "data"))
    server = urc_process(
        "serve", "puppet", "--simulate", "--port", "0", *data, "--behind-proxy", public
    )
    near = (await server.wait_for_async(r"^dashboard (http://127\.0\.0\.1:\d+)/"))[1]
    made = await asyncio.to_thread(run, "tokens", "add", "Patrol", "--role", "drive", *data)
    token = {"Authorization": f"Bearer {made.stdout.split()[0]}"}

    def socket_of(origin: str) -> connect:
        return connect(
            f"wss://{public}/ws?robot=puppet", host="127.0.0.1", port=port, ssl=trusted,
            origin=origin, additional_headers=token,  # type: ignore[arg-type]
        )  # fmt: skip

    async with nginx(configuration(tmp_path, port, near), port):
        reader, writer = await asyncio.open_connection(
            "127.0.0.1", port, ssl=trusted, server_hostname=NAME
        )
        head = f"Host: {public}\r\nAuthorization: {token['Authorization']}\r\nConnection: close"
        writer.write(f"GET /api/v1/robots HTTP/1.1\r\n{head}\r\n\r\n".encode())
        answer = (await reader.read()).decode()
        writer.close()
        assert answer.startswith("HTTP/1.1 200")
        assert '"puppet"' in answer
        async with socket_of(f"https://{public}") as page:
            async with asyncio.timeout(30):
                while "battery" not in str(await page.recv()):
                    pass
        with pytest.raises(InvalidStatus):
            await socket_of("https://elsewhere.example").__aenter__()

"""The dashboard over TLS, with real clients: Python, OpenSSL, and `urc send`."""

import asyncio
import contextlib
import ipaddress
import json
import re
import socket
import ssl
import subprocess
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from websockets.asyncio.client import ClientConnection, connect

from tests.e2e.command_line import run
from tests.e2e.dashboards import running_dashboard, until
from tests.e2e.keys import headers_for
from tests.e2e.processes import UrcProcess
from tests.e2e.test_dashboard_server import next_value, text_robot
from urc.access.authority import CertificateAuthority
from urc.runtime.running_servers import open_connection, servers
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS, BEARER
from urc.web.serve import certificates as module
from urc.web.serve.certificates import Certificates, LocalCertificate
from urc.web.serve.tls_listener import Handshakes

pytestmark = pytest.mark.anyio
Start = Callable[..., UrcProcess]
TELLO = "robots/tello.yaml"


def trusting(folder: Path) -> ssl.SSLContext:
    """Return what a client has that trusts the authority in a folder."""
    return ssl.create_default_context(cafile=str(folder / "authority.pem"))


def joined(address: str, trusted: ssl.SSLContext, **options: object) -> connect:
    """Return a connection to the robot's socket, as its own page makes it."""
    url = address.replace("https://", "wss://") + "ws?robot=puppet"
    options = {"compression": None, "additional_headers": BEARER, "ssl": trusted, **options}
    return connect(url, origin=address.rstrip("/"), **options)  # type: ignore[arg-type]


async def asked(address: str, path: str, trusted: ssl.SSLContext | None, head: str = "") -> bytes:
    """Ask on a connection of its own; return the whole answer."""
    parts = urlsplit(address)
    async with asyncio.timeout(30):
        reader, writer = await asyncio.open_connection(parts.hostname, parts.port, ssl=trusted)
        writer.write(f"GET {path} HTTP/1.1\r\nHost: {parts.netloc}\r\n{head}".encode())
        writer.write(b"Connection: close\r\n\r\n")
        answer = await reader.read()
        writer.close()
    return answer


async def test_a_client_that_reads_nothing_is_only_its_own_problem(tmp_path: Path) -> None:
    """Over TLS as over TCP: the other gets every value; the deaf one skips, in bounded memory."""
    robot, frames = text_robot(), 200
    certificates = await Certificates.of(LocalCertificate(tmp_path, "127.0.0.1"))
    trusted = trusting(tmp_path)
    async with (
        running_dashboard(robot, certificates=certificates) as address,
        joined(address, trusted) as quick,
    ):
        parts = urlsplit(address)
        assert parts.scheme == "https"
        raw = socket.create_connection((parts.hostname, parts.port))
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        async with joined(
            address, trusted, sock=raw, max_queue=1, server_hostname=parts.hostname
        ) as slow:
            assert json.loads(await slow.recv())["t"] == "hello"
            slow.transport.pause_reading()
            for number in range(frames):
                robot.set_reading("text", f"{number:06d}" + "x" * 4000)
                assert str(await next_value(quick)).startswith(f"{number:06d}")
            slow.transport.resume_reading()
            got = []
            while not got or not got[-1].startswith(f"{frames - 1:06d}"):
                got.append(str(await next_value(slow)))
        assert len(got) < frames / 2
        assert got == sorted(got)


async def test_dripping_handshakes_do_not_stop_a_page(tmp_path: Path) -> None:
    """Far more than may be open; pages keep their sockets, and new ones come in."""
    robot = FakeRobot(dashboard_profile())
    certificates = await Certificates.of(LocalCertificate(tmp_path, "127.0.0.1"))
    trusted = trusting(tmp_path)
    handshakes = Handshakes(certificates.context, most=32, limit_s=1.0)
    async with (
        running_dashboard(robot, certificates=certificates, handshakes=handshakes) as address,
        joined(address, trusted) as page,
    ):
        assert json.loads(await page.recv())["t"] == "hello"
        place = urlsplit(address)
        lines = []
        for _ in range(300):
            _, writer = await asyncio.open_connection(place.hostname, place.port)
            writer.write(b"\x16\x03\x01")
            lines.append(writer)
        await until(lambda: len(handshakes) <= 32)
        assert b" 200 OK" in await asked(address, "/healthz", trusted)
        async with joined(address, trusted) as other:
            assert json.loads(await other.recv())["t"] == "hello"
        await page.ping()
        await until(lambda: len(handshakes) == 0)
        for writer in lines:
            writer.transport.abort()


async def test_new_connections_get_a_renewed_certificate(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """An open socket goes on with its old one."""
    certificates = await Certificates.of(LocalCertificate(tmp_path, "127.0.0.1"))
    trusted = trusting(tmp_path)
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot, certificates=certificates) as address:

        def serial(line: ClientConnection) -> str:
            return str(line.transport.get_extra_info("peercert")["serialNumber"])

        async with joined(address, trusted) as old, joined(address, trusted) as same:
            found = (ipaddress.ip_address("10.0.0.9"),)
            monkeypatch.setattr(module, "local_addresses", lambda: found)
            assert await certificates.renew()
            async with joined(address, trusted) as new:
                assert serial(old) == serial(same) != serial(new)
                names = new.transport.get_extra_info("peercert")["subjectAltName"]
                assert ("IP Address", "10.0.0.9") in names
            await (await old.ping())


async def test_a_cookie_and_an_origin_of_https(tmp_path: Path) -> None:
    certificates = await Certificates.of(LocalCertificate(tmp_path, "127.0.0.1"))
    trusted = trusting(tmp_path)
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot, certificates=certificates) as address:
        answer = await asked(address, f"/?key={ACCESS.key}", trusted)
        assert re.search(rb"set-cookie: [^\r]*; Secure", answer)
        with pytest.raises(Exception, match="HTTP 403"):
            await connect(
                address.replace("https://", "wss://") + "ws?robot=puppet",
                origin=address.replace("https://", "http://").rstrip("/"),  # type: ignore[arg-type]
                ssl=trusted,
            )


@pytest.mark.needs("openssl")
@pytest.mark.parametrize(
    ("words", "verdict"),
    [
        (("-tls1_2",), "Verification: OK"),
        (("-tls1_3",), "Verification: OK"),
        (("-tls1_1", "-cipher", "ALL:@SECLEVEL=0"), "alert protocol version"),
        (("-tls1_2", "-cipher", "AES128-SHA"), "handshake failure"),
    ],
    ids=lambda one: one if isinstance(one, str) else one[0],
)
async def test_openssl_agrees(tmp_path: Path, words: tuple[str, ...], verdict: str) -> None:
    """Only modern versions and ciphers with forward secrecy."""
    certificates = await Certificates.of(LocalCertificate(tmp_path, "127.0.0.1"))
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot, certificates=certificates) as address:
        command = [
            "openssl", "s_client", "-connect", urlsplit(address).netloc, "-brief",
            "-CAfile", str(tmp_path / "authority.pem"), "-verify_ip", "127.0.0.1", *words,
        ]  # fmt: skip
        done = await asyncio.to_thread(
            subprocess.run, command, input=b"", capture_output=True, check=False, timeout=30
        )
        assert verdict in (done.stdout + done.stderr).decode()


async def test_a_server_for_others_prints_what_they_need(
    urc_process: Start, tmp_path: Path
) -> None:
    """This machine gets plain HTTP without a warning; others get HTTPS and a fingerprint."""
    words = ("--host", "0.0.0.0", "--port", "0", "--data-dir", str(tmp_path))
    process = urc_process("serve", TELLO, "--simulate", *words)
    near = (await process.wait_for_async(r"^dashboard (http://127\.0\.0\.1:\d+/)"))[1]
    others = (await process.wait_for_async(r"^for others (https://\S+)"))[1]
    plain = others.replace("https://", "http://")
    await process.wait_for_async(f"^new devices {re.escape(plain)}trust ")
    folder = tmp_path / "tls"
    shown = (await process.wait_for_async(r"^authority ([0-9A-F ]{79})$"))[1]
    authority = CertificateAuthority(folder, ["localhost"], datetime.now(UTC))
    assert shown == authority.fingerprint
    trusted = trusting(folder)

    assert b" 200 OK" in await asked(near, "/", None, _key(near))
    assert b" 200 OK" in await asked(others, "/healthz", trusted)
    assert b" 200 OK" in await asked(near.replace("http://", "https://"), "/healthz", trusted)
    if urlsplit(others).hostname != "127.0.0.1":
        answer = await asked(plain, "/robots/tello/", None)
        assert b" 307 " in answer
        assert f"location: {others}robots/tello/".encode() in answer
    page = await asked(plain, "/trust", None)
    assert all(one.encode() in page for one in shown.split())
    assert b"Tello" not in page
    head, _, body = (await asked(plain, "/trust/authority.crt", None)).partition(b"\r\n\r\n")
    assert b"content-type: application/x-x509-ca-cert" in head
    assert body == authority.pem
    with pytest.raises(ssl.SSLCertVerificationError):
        await asked(others, "/healthz", ssl.create_default_context())


def _key(address: str) -> str:
    return "".join(f"{name}: {value}\r\n" for name, value in headers_for(address).items())


async def test_plain_http_for_others_only_if_asked_for(urc_process: Start, tmp_path: Path) -> None:
    words = ("--host", "0.0.0.0", "--port", "0", "--data-dir", str(tmp_path))
    process = urc_process("serve", TELLO, "--simulate", *words, "--insecure-plain-http")
    others = (await process.wait_for_async(r"^for others (http://\S+)"))[1]
    await process.wait_for_async("^urc: 0.0.0.0 uses plain HTTP: everyone on the network can read")
    assert b" 200 OK" in await asked(others, "/healthz", None)
    assert not (tmp_path / "tls").exists()
    page = await asked(others, "/trust", None)
    assert b" 200 OK" in page
    assert b"authority.crt" not in page
    assert b" 404 " in await asked(others, "/trust/authority.crt", None, _key(others))


async def test_a_certificate_of_the_operator(urc_process: Start, tmp_path: Path) -> None:
    """Local programs check it by its file, whatever its name is."""
    issued = CertificateAuthority(tmp_path / "ca", ["robots.lab"], datetime.now(UTC)).issue()
    files = ("--tls-cert", str(issued.chain), "--tls-key", str(issued.key))
    data = tmp_path / "data"
    process = urc_process(
        "serve", TELLO, "--simulate", "--port", "0", *files, "--data-dir", str(data)
    )
    address = (await process.wait_for_async(r"^dashboard (https://127\.0\.0\.1:\d+/)"))[1]
    await process.wait_for_async(r"^certificate [0-9A-F ]{79}$")
    (server,) = servers(data).values()
    assert server.address == address

    def status(certificate: str, name: str) -> int:
        found = server._replace(certificate=certificate, name=name)
        line = open_connection(found, 10)
        with contextlib.closing(line):
            line.request("GET", "/healthz")
            return line.getresponse().status

    assert (server.certificate, server.name) == (str(issued.chain), "robots.lab")
    assert await asyncio.to_thread(status, server.certificate, server.name) == 200
    other = CertificateAuthority(tmp_path / "other", ["robots.lab"], datetime.now(UTC)).issue()
    for certificate, name in ((str(other.chain), "robots.lab"), (server.certificate, "x.lab")):
        with pytest.raises(ssl.SSLCertVerificationError):
            await asyncio.to_thread(status, certificate, name)


ROVER = """\
urc: 1
kind: robot
name: cart
transports:
  line:
    { type: tcp, host: 127.0.0.1, port: 9, framing: { type: delimiter, tx: LF, rx: LF } }
commands:
  go: { moves: true, send: go }
"""


async def test_urc_send_asks_a_server_over_https(urc_process: Start, tmp_path: Path) -> None:
    """It verifies the server by the authority; with another authority, nothing moves."""
    file = tmp_path / "cart.yaml"
    file.write_text(ROVER, encoding="utf-8")
    place = ("--data-dir", str(tmp_path / "data"))
    process = urc_process("serve", str(file), "--port", "0", "--tls", "auto", *place)
    address = (await process.wait_for_async(r"^dashboard (https://127\.0\.0\.1:\d+/)"))[1]
    trusted = trusting(tmp_path / "data" / "tls")
    url = address.replace("https://", "wss://") + "ws?robot=cart"
    async with connect(
        url,
        origin=address.rstrip("/"),  # type: ignore[arg-type]
        additional_headers=headers_for(address),
        ssl=trusted,
    ) as screen:
        await screen.send(json.dumps({"t": "drive", "verb": "take"}))
        async for said in screen:
            if (lease := json.loads(said))["t"] == "lease" and lease["holder"]:
                break
        done = await asyncio.to_thread(run, "send", str(file), "go", *place)
        assert f"screen 1 is driving the robot on {address}" in done.stderr
        (tmp_path / "data" / "tls" / "authority.pem").write_bytes(
            CertificateAuthority(tmp_path / "other", ["localhost"], datetime.now(UTC)).pem
        )
        done = await asyncio.to_thread(run, "send", str(file), "go", *place)
        assert f"the server at {address} does not report the operator" in done.stderr


async def test_behind_a_web_server_by_name(urc_process: Start, tmp_path: Path) -> None:
    """Origins and cookies are those of HTTPS for that name, and of HTTP for this machine."""
    process = urc_process(
        "serve", TELLO, "--simulate", "--port", "0", "--data-dir", str(tmp_path),
        "--behind-proxy", "robots.example",
    )  # fmt: skip
    near = (await process.wait_for_async(r"^dashboard (http://127\.0\.0\.1:\d+/)"))[1]
    (server,) = servers(tmp_path).values()
    assert server.public == "https://robots.example/"
    place = urlsplit(near)

    async def status(host: str, origin: str) -> str:
        reader, writer = await asyncio.open_connection(place.hostname, place.port)
        head = f"Host: {host}\r\nOrigin: {origin}\r\nContent-Length: 0\r\nConnection: close"
        path = "/api/v1/robots/tello/stop"
        writer.write(f"POST {path} HTTP/1.1\r\n{head}\r\n\r\n".encode())
        line = await reader.readline()
        writer.close()
        return line.split()[1].decode()

    assert await status("robots.example", "https://robots.example") == "200"
    assert await status("robots.example", "http://robots.example") == "403"
    assert await status(place.netloc, f"http://{place.netloc}") == "200"
    assert await status(place.netloc, f"https://{place.netloc}") == "403"
    assert await status("other.example", "https://other.example") == "421"
    key = headers_for(near)["Authorization"].removeprefix("Bearer ")
    reader, writer = await asyncio.open_connection(place.hostname, place.port)
    writer.write(
        f"GET /?key={key} HTTP/1.1\r\nHost: robots.example\r\nConnection: close\r\n\r\n".encode()
    )
    assert re.search(rb"set-cookie: [^\r]*; Secure", await reader.read())
    writer.close()

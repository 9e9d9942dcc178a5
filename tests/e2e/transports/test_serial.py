"""Serial ports beyond the contract: socat's pseudo-terminals, ser2net, plugs that are pulled."""

import asyncio
import errno
import fcntl
import grp
import os
import sys
import termios
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.e2e.ports import free_port
from tests.e2e.processes import UrcProcess
from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.packets import Loss
from tests.e2e.transports.programs import listens, program
from urc.model.driver import Backoff, Timeouts, TransportSpec
from urc.model.profile import Profile
from urc.problems import UrcError
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session
from urc.simulator.emulated_profile import stand_in
from urc.simulator.server import serve
from urc.testing.profile import line_profile
from urc.transports.base import ConnectFailed, PeerClosed, TransportError, TransportSetup
from urc.transports.serial import SerialTransport, explain, from_setup

pytestmark = [pytest.mark.anyio, pytest.mark.needs("socat")]

WAIT_S = 20.0
ASK = b"Give me the battery %\n"


def line(port: Path | str, **options: object) -> SerialTransport:
    made = from_setup(TransportSetup("wire", {"port": str(port), **options}))
    assert isinstance(made, SerialTransport)
    return made


@asynccontextmanager
async def cable(folder: Path, far_end: str = "PIPE") -> AsyncIterator[Path]:
    """Let socat be a port with something at its other end: an echo, or what `far_end` names."""
    port = folder / "port"
    # socat reads and writes in turn: a write beyond one free page of its pipe would block for ever.
    async with program("socat", "-b4096", f"PTY,raw,echo=0,link={port}", far_end):
        await listens(port)
        yield port
    port.unlink(missing_ok=True)


@asynccontextmanager
async def opened(transport: SerialTransport) -> AsyncIterator[SerialTransport]:
    async with nothing_left():
        await transport.open(20.0)
        try:
            yield transport
        finally:
            await transport.close()


async def says_back(transport: SerialTransport, data: bytes) -> None:
    got = b""
    async with asyncio.timeout(WAIT_S):
        sending = asyncio.ensure_future(transport.send(data))
        while len(got) < len(data):
            got += await transport.receive()
        await sending
    assert got == data


async def test_port_of_this_machine(tmp_path: Path) -> None:
    """Every byte passes as it is, and much of it both ways at once."""
    async with cable(tmp_path) as port, opened(line(port, baud=57600)) as transport:
        assert transport.address == f"serial {port}"
        await says_back(transport, bytes(range(256)))
        await says_back(transport, bytes(range(256)) * 1000)


async def test_port_is_set_up_as_the_document_says(tmp_path: Path) -> None:
    """Read back from the system, which is what the wire gets."""
    async with cable(tmp_path) as port:
        options = {"baud": 9600, "stop_bits": 2, "flow_control": "xon_xoff"}
        async with opened(line(port, **options)):
            number = os.open(port, os.O_RDWR | os.O_NOCTTY)
            flags_in, _, control, local, _, speed, _ = termios.tcgetattr(number)
            os.close(number)
            assert speed == termios.B9600
            assert control & termios.CSTOPB
            assert flags_in & termios.IXON
            assert not local & (termios.ECHO | termios.ICANON)


async def waiting(number: int, count: int) -> None:
    """Wait until `count` bytes lie in a port that nobody reads."""
    async with asyncio.timeout(WAIT_S):
        while True:
            answer = fcntl.ioctl(number, termios.FIONREAD, bytes(4))
            if int.from_bytes(answer, sys.byteorder) == count:
                return
            await asyncio.sleep(0.01)


async def test_what_came_before_is_not_heard(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A line that lay in the buffer since yesterday is no reading of today."""
    monkeypatch.setattr("urc.transports._serial_port._DRAIN_S", WAIT_S)  # a busy machine is late
    inlet = free_port()
    async with cable(tmp_path, f"TCP-LISTEN:{inlet},bind=127.0.0.1") as port:
        await listens(inlet)
        other = await asyncio.to_thread(os.open, port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        reader, writer = await asyncio.open_connection("127.0.0.1", inlet)
        try:
            writer.write(b"old\n")
            await waiting(other, len(b"old\n"))
            async with opened(line(port)) as transport:
                writer.write(b"new\n")
                assert await asyncio.wait_for(transport.receive(), WAIT_S) == b"new\n"
                await transport.send(b"last words\n")
                await transport.close()  # what was handed over before still arrives
                assert await asyncio.wait_for(reader.readline(), WAIT_S) == b"last words\n"
        finally:
            os.close(other)
            writer.transport.abort()


async def test_two_programs_do_not_share_a_port(tmp_path: Path) -> None:
    """Unless the document says that they may."""
    async with cable(tmp_path) as port, opened(line(port)):
        with pytest.raises(ConnectFailed) as told:
            await line(port).open(20.0)
        assert str(told.value) == f"{port} is in use by another program"
        shared = line(port, exclusive=False)
        await shared.open(20.0)
        await shared.close()


async def test_what_is_no_port_is_told(tmp_path: Path) -> None:
    """Nothing there, a folder, a file: each in words of its own."""
    file = tmp_path / "notes.txt"
    file.write_text("notes")
    for path, told in (
        (tmp_path / "ttyUSB0", f"there is no {tmp_path}/ttyUSB0; is it plugged in?"),
        (tmp_path, f"{tmp_path} is not a serial port"),
        (file, f"{file} is not a serial port"),
    ):
        async with nothing_left():
            with pytest.raises(ConnectFailed) as problem:
                await line(path).open(20.0)
            assert str(problem.value) == told


async def test_missing_permission_names_the_group(tmp_path: Path) -> None:
    """The commonest trouble of all, with its remedy."""
    denied = PermissionError(errno.EACCES, "Permission denied")
    port = tmp_path / "ttyUSB0"
    port.touch(mode=0o660)
    if os.geteuid() == 0:
        os.chown(port, -1, grp.getgrnam("dialout").gr_gid)
    port.chmod(0o660)
    group = grp.getgrgid(port.stat().st_gid).gr_name
    assert explain(str(port), str(port), denied) == (
        f"no permission for {port}; add yourself to the group {group!r}: "
        f"sudo usermod -aG {group} $USER, and sign in again"
    )
    port.chmod(0o600)
    told = f"no permission for {port}; its mode is 600, and it belongs to the group {group!r}"
    assert explain(str(port), str(port), denied) == told
    gone = str(tmp_path / "gone")
    assert explain(gone, gone, denied) == f"no permission for {gone}"


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"port": ""}, "serial needs a port, such as /dev/ttyUSB0 or socket://HOST:PORT"),
        (
            {"port": "socket://arm"},
            "serial: port must have the form socket://HOST:PORT, not 'socket://arm'",
        ),
        ({"baud": "fast"}, "serial: baud must be an integer from 50 to 20000000, not 'fast'"),
        ({"data_bits": 9}, "serial: data_bits must be an integer from 5 to 8, not 9"),
        ({"parity": "N"}, "serial: parity must be none | odd | even | mark | space, not 'N'"),
        ({"stop_bits": 3}, "serial: stop_bits must be 1 | 1.5 | 2, not 3"),
        ({"dtr": "low"}, "serial: dtr must be true or false, not 'low'"),
    ],
)
async def test_bad_option_is_one_line(options: dict[str, object], told: str) -> None:
    with pytest.raises(TransportError) as problem:
        from_setup(TransportSetup("wire", {"port": "/dev/ttyUSB0", **options}))
    assert str(problem.value) == told


# ---- behind a server


@asynccontextmanager
async def ser2net(folder: Path, port: Path, accepter: str) -> AsyncIterator[int]:
    """Run ser2net in front of a port; give its own."""
    number = free_port()
    file = folder / "ser2net.yaml"
    file.write_text(
        "connection: &robot\n"
        f"  accepter: {accepter},127.0.0.1,{number}\n"
        f"  connector: serialdev,{port},9600n81,local\n"
    )
    async with program("ser2net", "-n", "-u", "-c", str(file)):
        await listens(number)
        yield number


async def until_taken(transport: SerialTransport) -> None:
    """Open it and talk; ser2net needs a moment until it takes another client."""
    async with asyncio.timeout(2 * WAIT_S):
        while True:
            try:
                await transport.open(20.0)
                await says_back(transport, ASK)
            except (TransportError, AssertionError):  # it says that the port is in use
                await transport.close()
                await asyncio.sleep(0.05)
            else:
                return


@pytest.mark.needs("ser2net")
@pytest.mark.parametrize(
    ("scheme", "accepter"), [("socket", "tcp"), ("rfc2217", "telnet(rfc2217),tcp")]
)
async def test_port_behind_a_server(tmp_path: Path, scheme: str, accepter: str) -> None:
    """All bytes pass, those that Telnet would take for its own included; a dead server is told."""
    async with cable(tmp_path) as port:
        async with ser2net(tmp_path, port, accepter) as number:
            transport = line(f"{scheme}://127.0.0.1:{number}", baud=57600)
            async with nothing_left():
                for _ in range(2):
                    await until_taken(transport)
                    await says_back(transport, bytes(range(256)) * 20)
                    await transport.close()
            await until_taken(transport)
            if scheme == "rfc2217":
                assert await port_speed(port) == termios.B57600
        with pytest.raises(PeerClosed):
            await asyncio.wait_for(transport.receive(), WAIT_S)
        await transport.close()
        with pytest.raises(ConnectFailed) as told:
            await transport.open(20.0)
        place = f"127.0.0.1:{number}"
        assert str(told.value) == f"nothing listens on {place} (connection refused)"


@pytest.mark.needs("ser2net")
@pytest.mark.needs("iptables")
async def test_server_that_vanishes_is_told(tmp_path: Path) -> None:
    """As any line over the network: what is sent is not acknowledged."""
    async with (
        cable(tmp_path) as port,
        ser2net(tmp_path, port, "telnet(rfc2217),tcp") as number,
        opened(line(f"rfc2217://127.0.0.1:{number}")) as transport,
    ):
        await says_back(transport, ASK)
        loss = Loss(number)
        try:
            await loss.begin()
            await transport.send(ASK)
            assert transport.unsent() > 0
            with pytest.raises(PeerClosed) as told:
                await asyncio.wait_for(transport.receive(), 2 * WAIT_S)
            assert str(told.value) == "the connection broke (connection timed out)"
        finally:
            await loss.end()


async def port_speed(port: Path) -> int:
    number = await asyncio.to_thread(os.open, port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        return int(termios.tcgetattr(number)[5])
    finally:
        os.close(number)


async def test_server_that_says_nothing_is_given_up(tmp_path: Path) -> None:
    """It takes the call, and never answers what RFC 2217 asks."""
    port = free_port()
    listening = f"TCP-LISTEN:{port},bind=127.0.0.1,fork,reuseaddr"
    async with program("socat", "-u", listening, "OPEN:/dev/null"), nothing_left():
        await listens(port)
        for _ in range(2):
            with pytest.raises(ConnectFailed) as told:
                await asyncio.wait_for(line(f"rfc2217://127.0.0.1:{port}").open(0.5), 20.0)
            assert str(told.value) == f"no answer from 127.0.0.1:{port} within 0.5 s"


# ---- a whole session


def serial_profile(port: str) -> Profile:
    """The puppet on a serial port."""
    profile = line_profile(
        every_s=0.1,
        transport="serial",
        timeouts=Timeouts(connect_s=10.0, reply_s=5.0),
        backoff=Backoff(initial_s=0.05, max_s=0.2),
    )
    driver = profile.driver
    wire: TransportSpec = driver.transports["wire"]._replace(options={"port": port})
    return profile._replace(driver=driver._replace(transports={"wire": wire}))


SETTINGS = {"host": "127.0.0.1", "port": 1}


async def until(session: Session, state: str, detail: str = "") -> None:
    with session.hub.subscribe() as subscription:
        async with asyncio.timeout(WAIT_S):
            while True:
                link = session.hub.links["wire"]
                if link.state == state and detail in ("", link.detail):
                    return
                subscription.changes()
                await subscription.changed()


async def test_adapter_that_is_pulled_out_comes_back(tmp_path: Path) -> None:
    """The same session, twice: lost with a reason, live again as soon as the port is there."""
    port = tmp_path / "ttyUSB0"
    profile = serial_profile(str(port))
    async with Session(profile, SETTINGS, built_in_catalog().transports) as session:
        for _ in range(2):
            await until(session, "lost")
            async with serve(profile, SETTINGS, now=lambda: 42.0) as listening:
                assert listening["wire"].text.endswith(f", as {port}")
                await until(session, "live")
                assert (await session.command("ask")).values == {"battery": 42}
            assert not port.is_symlink()
        await until(session, "lost", f"there is no {port}; is it plugged in?")


@pytest.mark.parametrize("port", ["/dev/ttyUSB0", "socket://127.0.0.1:1", "rfc2217://127.0.0.1:1"])
async def test_emulated_robot_stands_in_where_it_is_free(port: str) -> None:
    """For the demo: nobody has the port, and the profile leads to the emulated one."""
    async with (
        stand_in(serial_profile(port), SETTINGS) as redirected,
        Session(redirected, SETTINGS, built_in_catalog().transports) as session,
    ):
        for _ in range(3):
            values = (await session.command("ask")).values
            assert 0 <= values["battery"] < 100  # type: ignore[operator]


async def test_server_that_sets_ports_up_is_not_emulated(tmp_path: Path) -> None:
    """Nor is a name where nothing can be made; both are told before anything listens."""
    taken = tmp_path / "no" / "such" / "folder"
    for port, told in (
        (
            "rfc2217://127.0.0.1:2217",
            "expected a path or socket://HOST:PORT, found 'rfc2217://127.0.0.1:2217'",
        ),
        (str(taken), f"cannot create {taken} (no such file or directory)"),
    ):
        async with nothing_left():
            with pytest.raises(UrcError) as problem:
                async with serve(serial_profile(port), SETTINGS):
                    pytest.fail("it listens")
            assert str(problem.value).endswith(told)


async def test_emulated_port_serves_one_client_after_another() -> None:
    """Who opens it next finds a robot that has not heard half a question."""
    async with serve(serial_profile(""), SETTINGS, now=lambda: 7.0) as listening:
        path = listening["wire"].path
        assert listening["wire"].text == f"serial {path}"
        for _ in range(3):
            async with opened(line(path)) as transport:
                await transport.send(ASK)
                assert await asyncio.wait_for(transport.receive(), WAIT_S) == b"7\n"
                await transport.send(b"Give me the bat")
                await asyncio.sleep(0.1)
            await asyncio.sleep(0.1)


async def test_other_programs_talk_to_the_emulated_port(tmp_path: Path, urc_process) -> None:  # type: ignore[no-untyped-def]
    """`urc simulate` prints the name, and socat asks there."""
    document = tmp_path / "base.yaml"
    page = Path(__file__).resolve().parents[3] / "docs" / "transports" / "serial.md"
    document.write_text(page.read_text("utf-8").split("```yaml\n")[1].split("```")[0], "utf-8")
    robot: UrcProcess = urc_process("simulate", str(document))
    path = (await robot.wait_for_async(r"^listening wire serial (/dev/pts/\d+)$"))[1]
    socat = await asyncio.create_subprocess_exec(
        "socat",
        "-t1",
        "STDIO",
        f"{path},raw,echo=0",
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
    )
    assert socat.stdin is not None
    assert socat.stdout is not None
    socat.stdin.write(b"V\r")
    said = await asyncio.wait_for(socat.stdout.readuntil(b"\r\n"), WAIT_S)
    assert said.startswith(b"V=")
    socat.stdin.close()
    await asyncio.wait_for(socat.wait(), WAIT_S)

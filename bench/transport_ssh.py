"""SSH: the transport against asyncssh itself, both to one long-lived cat on OpenSSH's server."""

import getpass
import os
import platform
import shutil
import socket
import tempfile
from collections.abc import Sequence
from pathlib import Path

import asyncssh

from bench.harness import Result
from bench.wire import Wire, measured, of_transport, running
from urc.transports.base import Setup
from urc.transports.ssh import from_setup

__all__ = ["run"]


def run(*, full: bool = False) -> Sequence[Result]:
    """Measure the transport ``ssh``."""
    program = shutil.which("sshd", path=f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin")
    if program is None:
        raise SystemExit("bench: there is no sshd; apt-get install openssh-server")
    if os.geteuid() == 0:
        Path("/run/sshd").mkdir(mode=0o755, exist_ok=True)  # it refuses to start without
    with tempfile.TemporaryDirectory() as folder, socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        probe.close()
        configuration, key, host_key = _prepare(Path(folder), port)

        def is_ready() -> bool:
            return f":{port:04X} 00000000:0000 0A" in Path("/proc/net/tcp").read_text("ascii")

        async def bare() -> Wire:
            connection = await asyncssh.connect(
                "127.0.0.1", port, username=getpass.getuser(), client_keys=[key], config=None,
                known_hosts=([host_key], [], []), agent_path=None,
            )  # fmt: skip
            process = await connection.create_process("cat", encoding=None)

            async def send(data: bytes) -> None:
                process.stdin.write(data)
                await process.stdin.drain()

            async def close() -> None:
                connection.abort()
                await connection.wait_closed()

            return Wire(send, lambda: process.stdout.read(65536), close)

        options = {
            "host": "127.0.0.1", "port": port, "username": getpass.getuser(), "key": key,
            "host_key": host_key.get_fingerprint("sha256"), "mode": "exec", "command": "cat",
        }  # fmt: skip
        with running(program, "-D", "-e", "-f", str(configuration), is_ready=is_ready):
            return measured(
                "transport_ssh",
                bare,
                lambda: of_transport(from_setup(Setup("wire", options))),
                trips=1000,
                batches=20,
                batch=400,
                rounds=25 if full else 11,
                versions={"python": platform.python_version(), "asyncssh": asyncssh.__version__},
            )


def _prepare(folder: Path, port: int) -> tuple[Path, str, asyncssh.SSHKey]:
    """Write what a server for this user alone needs; return its file, a key, its own key."""
    key, host_key = (asyncssh.generate_private_key("ssh-ed25519") for _ in range(2))
    for name, one in (("key", key), ("host_key", host_key)):
        one.write_private_key(folder / name)
        (folder / name).chmod(0o600)
    key.write_public_key(folder / "authorized_keys")
    configuration = folder / "sshd_config"
    configuration.write_text(
        f"Port {port}\nListenAddress 127.0.0.1\nHostKey {folder / 'host_key'}\n"
        f"AuthorizedKeysFile {folder / 'authorized_keys'}\nStrictModes no\nUsePAM no\n"
        f"PidFile {folder / 'pid'}\nLogLevel ERROR\n",
        "ascii",
    )
    return configuration, str(folder / "key"), host_key.convert_to_public()

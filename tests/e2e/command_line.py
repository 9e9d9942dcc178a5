"""What the tests of the `urc` command share: a robot's file, runs to the end, other programs."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.request import Request, urlopen

from tests.e2e.keys import headers_for
from tests.e2e.processes import ROOT

URC = (sys.executable, "-m", "urc.cli.main")
PUPPET = "robots/puppet.yaml"
TIMEOUT_S = 30.0

BOT = """\
urc: 1
kind: robot
name: bot
settings:
  host: { type: host }
  port: { type: port }
transports:
  wire:
    type: tcp
    host: "{{ settings.host }}"
    port: "{{ settings.port }}"
    framing: { type: delimiter, tx: LF, rx: LF }
signals:
  speed: { type: integer, unit: km/h }
commands:
  set_speed:
    args: { speed: { type: integer, min: 0, max: 9 } }
    send: "speed {{ speed }}"
  ask:
    send: "speed?"
    reply: { regex: '^(?P<speed>\\d+)$', errors: ['^ERR'], timeout: 20s }
messages:
  said: { regex: '^s (?P<speed>\\d+)$' }
simulator:
  wire:
    - { match: '^speed\\?$', send: "7" }
"""
"""A robot with a line that stays open, commands, and settings without a default."""


def at(port: int | str) -> tuple[str, ...]:
    return "--set", "host=127.0.0.1", "--set", f"port={port}"


def run(
    *words: str | bytes, stdout: int = subprocess.PIPE, cwd: Path = ROOT, **environment: str | bytes
) -> subprocess.CompletedProcess[str]:
    """Run `urc` to its end, without a terminal."""
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [*URC, *words],
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": path} | environment,
        stdin=subprocess.DEVNULL,
        stdout=stdout,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        timeout=TIMEOUT_S,
        check=False,
    )


@contextmanager
def program(*command: str) -> Iterator[None]:
    """Run a program that is not URC, with all its children, until the context ends."""
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:
        yield
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)
        process.wait(TIMEOUT_S)


def wait_for_listener(port: int) -> None:
    deadline = time.monotonic() + TIMEOUT_S
    while True:
        with suppress(ConnectionRefusedError), socket.create_connection(("127.0.0.1", port)):
            return
        assert time.monotonic() < deadline, f"nothing listens on {port}"
        time.sleep(0.02)


def page(url: str) -> str:
    asked = Request(url, headers=headers_for(url))  # noqa: S310 (URC's own address)
    with urlopen(asked, timeout=TIMEOUT_S) as answer:  # noqa: S310
        return str(answer.read().decode())

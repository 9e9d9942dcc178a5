"""The MQTT transport against bare paho, through one Mosquitto."""

import asyncio
import logging
import shutil
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from bench.harness import Goal, Result, compare
from urc.model.codec import Envelope
from urc.transports.base import Setup, Subscription
from urc.transports.mqtt import from_setup

ROUND_TRIP = Goal("mqtt: round trip / paho's", 1.3)
THROUGH = Goal("mqtt: time for 2000 messages there and back / paho's", 1.25)
TRIPS, MESSAGES, WAIT_S = 200, 2000, 30.0
AT_ONCE = 50
"""Messages under way at one time: more than one turn of the loop, less than any queue."""
BODY = b"24.31 87 0.01 -0.02 9.81"


def run(*, full: bool) -> list[Result]:
    rounds = 21 if full else 7
    versions = {"paho-mqtt": version("paho-mqtt")}
    logging.disable(logging.INFO)
    with broker() as port:
        bare, ours = Bare(port), Ours(port)
        try:
            return [
                compare(ROUND_TRIP, bare.trips, ours.trips, rounds=rounds, versions=versions),
                compare(THROUGH, bare.through, ours.through, rounds=rounds, versions=versions),
            ]
        finally:
            ours.close()
            bare.close()


@contextmanager
def broker() -> Iterator[int]:
    """Start Mosquitto on a free port of loopback."""
    program = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")
    if program is None:
        raise SystemExit("bench: mosquitto is not installed; apt-get install mosquitto")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    with tempfile.TemporaryDirectory() as folder:
        settings = Path(folder, "mosquitto.conf")
        settings.write_text(
            f"listener {port} 127.0.0.1\nallow_anonymous true\nset_tcp_nodelay true\n"
        )
        command = [program, "-c", str(settings)]
        with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
            try:
                until = time.monotonic() + WAIT_S
                while True:
                    try:
                        socket.create_connection(("127.0.0.1", port), 1).close()
                        break
                    except OSError:
                        assert time.monotonic() < until
                        time.sleep(0.02)
                yield port
            finally:
                process.terminate()


class Bare:
    """paho as its documentation shows it: on its own thread, with callbacks."""

    def __init__(self, port: int) -> None:
        self.heard = threading.Semaphore(0)
        ready = threading.Event()
        self.client = paho.Client(CallbackAPIVersion.VERSION2)
        self.client.on_message = lambda *_: self.heard.release()
        self.client.on_subscribe = lambda *_: ready.set()
        self.client.connect("127.0.0.1", port)
        # paho leaves it out, and then waits 40 ms for every acknowledgement the kernel holds back.
        line = self.client.socket()
        assert isinstance(line, socket.socket)
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.client.loop_start()
        self.client.subscribe("bare")
        assert ready.wait(WAIT_S)

    def trips(self) -> float:
        began = time.perf_counter()
        for _ in range(TRIPS):
            self.client.publish("bare", BODY)
            assert self.heard.acquire(timeout=WAIT_S)
        return time.perf_counter() - began

    def through(self) -> float:
        began = time.perf_counter()
        for _ in range(MESSAGES // AT_ONCE):
            for _ in range(AT_ONCE):
                self.client.publish("bare", BODY)
            for _ in range(AT_ONCE):
                assert self.heard.acquire(timeout=WAIT_S)
        return time.perf_counter() - began

    def close(self) -> None:
        self.client.disconnect()
        self.client.loop_stop()


class Ours:
    """The transport in one asyncio loop, as the engine uses it."""

    def __init__(self, port: int) -> None:
        options = {"host": "127.0.0.1", "port": port, "version": "3.1.1"}
        self.line = from_setup(Setup("wire", options, (Subscription("ours"),)))
        self.runner = asyncio.Runner()
        self.runner.run(self.line.open(WAIT_S))
        self.message = Envelope("publish", {"topic": "ours"}, BODY)

    def trips(self) -> float:
        return self.runner.run(self._go(TRIPS, 1))

    def through(self) -> float:
        return self.runner.run(self._go(MESSAGES // AT_ONCE, AT_ONCE))

    async def _go(self, times: int, at_once: int) -> float:
        began = time.perf_counter()
        for _ in range(times):
            for _ in range(at_once):
                await self.line.send(self.message)
            for _ in range(at_once):
                await self.line.receive()
        return time.perf_counter() - began

    def close(self) -> None:
        self.runner.run(self.line.close())
        self.runner.close()

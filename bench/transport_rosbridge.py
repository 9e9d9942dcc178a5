"""The rosbridge transport against bare roslibpy, to one server in a process of its own."""

import asyncio
import logging
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version

import roslibpy

from bench.harness import Goal, Result, compare
from urc.model.codec import Envelope
from urc.transports.base import Setup, Subscription, Transport
from urc.transports.rosbridge import from_setup

ROUND_TRIP = Goal("rosbridge: round trip / roslibpy's", 1.3)
TAKEN = Goal("rosbridge: time to take 1000 Imu / roslibpy's", 1.25)
PUBLISHED = Goal("rosbridge: time to publish 1000 Twist / roslibpy's", 1.25)
TRIPS, MESSAGES, WAIT_S = 100, 1000, 30.0
TWIST = {"linear": {"x": 0.2, "y": 0, "z": 0}, "angular": {"x": 0, "y": 0, "z": -0.5}}


def run(*, full: bool) -> list[Result]:
    rounds = 21 if full else 7
    versions = {name: version(name) for name in ("roslibpy", "websockets", "autobahn")}
    logging.getLogger("roslibpy").setLevel(logging.ERROR)
    with server() as port:
        bare, ours = Bare(port), Ours(port)
        try:
            return [
                compare(ROUND_TRIP, bare.trips, ours.trips, rounds=rounds, versions=versions),
                compare(TAKEN, bare.take, ours.take, rounds=rounds, versions=versions),
                compare(PUBLISHED, bare.publish, ours.publish, rounds=rounds, versions=versions),
            ]
        finally:
            ours.close()
            bare.close()


@contextmanager
def server() -> Iterator[int]:
    command = [sys.executable, "-m", "bench.rosbridge_echo"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield int(process.stdout.readline())
        finally:
            process.terminate()


class Bare:
    """roslibpy as its documentation shows it: on its own thread, with callbacks."""

    def __init__(self, port: int) -> None:
        self.ros = roslibpy.Ros("127.0.0.1", port)
        self.ros.run()
        self.ask = roslibpy.Topic(self.ros, "/ask", "geometry_msgs/Twist")
        self.said = threading.Event()
        self.answer = roslibpy.Topic(self.ros, "/answer", "geometry_msgs/Twist")
        self.answer.subscribe(lambda _: self.said.set())
        self.heard = 0
        roslibpy.Topic(self.ros, "/imu", "sensor_msgs/Imu").subscribe(self.hear)
        self.sink = roslibpy.Topic(self.ros, "/sink", "geometry_msgs/Twist")
        self.flood = roslibpy.Service(self.ros, "/flood", "x/Flood")
        self.count = roslibpy.Service(self.ros, "/count", "x/Count")

    def hear(self, message: object) -> None:
        self.heard += 1

    def trips(self) -> float:
        began = time.perf_counter()
        for _ in range(TRIPS):
            self.said.clear()
            self.ask.publish(roslibpy.Message(TWIST))
            assert self.said.wait(WAIT_S)
        return time.perf_counter() - began

    def take(self) -> float:
        self.heard = 0
        began = time.perf_counter()
        self.flood.call(roslibpy.ServiceRequest({"count": MESSAGES}), timeout=WAIT_S)
        seconds = time.perf_counter() - began
        assert self.heard == MESSAGES
        return seconds

    def publish(self) -> float:
        began = time.perf_counter()
        for _ in range(MESSAGES):
            self.sink.publish(roslibpy.Message(TWIST))
        count = self.count.call(roslibpy.ServiceRequest(), timeout=WAIT_S)["count"]
        seconds = time.perf_counter() - began
        assert count >= MESSAGES
        return seconds

    def close(self) -> None:
        self.ros.terminate()


class Ours:
    """The transport in one asyncio loop, as the engine uses it."""

    def __init__(self, port: int) -> None:
        topics = (Subscription("/answer"), Subscription("/imu"))
        self.line: Transport = from_setup(Setup("ros", {"host": "127.0.0.1", "port": port}, topics))
        self.runner = asyncio.Runner()
        self.number = 0
        self.runner.run(self.line.open(WAIT_S))
        self.runner.run(self.forget_warnings())

    async def forget_warnings(self) -> None:
        await asyncio.sleep(0.1)

    def trips(self) -> float:
        return self.runner.run(self._trips())

    def take(self) -> float:
        return self.runner.run(self._take())

    def publish(self) -> float:
        return self.runner.run(self._publish())

    async def _trips(self) -> float:
        ask = Envelope("publish", {"topic": "/ask", "type": "geometry_msgs/Twist"}, TWIST)
        began = time.perf_counter()
        for _ in range(TRIPS):
            await self.line.send(ask)
            heard = await self.line.receive()
            assert isinstance(heard, Envelope)
            assert heard.attributes["topic"] == "/answer"
        return time.perf_counter() - began

    async def _take(self) -> float:
        heard = 0
        began = time.perf_counter()
        await self._call("/flood", {"count": MESSAGES})
        while True:
            said = await self.line.receive()
            assert isinstance(said, Envelope)
            if said.verb == "response":
                break
            heard += 1
        seconds = time.perf_counter() - began
        assert heard == MESSAGES, heard
        return seconds

    async def _publish(self) -> float:
        twist = Envelope("publish", {"topic": "/sink", "type": "geometry_msgs/Twist"}, TWIST)
        began = time.perf_counter()
        for _ in range(MESSAGES):
            await self.line.send(twist)
        await self._call("/count", {})
        said = await self.line.receive()
        seconds = time.perf_counter() - began
        assert isinstance(said, Envelope)
        assert isinstance(said.body, dict)
        assert said.body["count"] >= MESSAGES
        return seconds

    async def _call(self, service: str, args: dict[str, object]) -> None:
        self.number += 1
        await self.line.send(Envelope("call", {"service": service, "id": self.number}, args))

    def close(self) -> None:
        self.runner.run(self.line.close())
        self.runner.close()

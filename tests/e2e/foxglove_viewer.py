"""Foxglove's own client, in Node, as a viewer of a test's server."""

import json
import queue
import subprocess
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from scripts.node import node_executable

__all__ = ["Viewer"]

_SCRIPT = Path(__file__).with_suffix(".mjs")
_WAIT_S = 15.0


class Viewer:
    """A viewer; its events are kept in order."""

    def __init__(self, address: str, *subprotocols: str) -> None:
        node = node_executable()
        assert node is not None
        self._process = subprocess.Popen(
            [node, str(_SCRIPT), address, *subprotocols],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.events: list[dict[str, Any]] = []
        self.channels: dict[str, dict[str, Any]] = {}
        self.services: dict[str, dict[str, Any]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._process.kill()
        self._process.wait(_WAIT_S)
        self._reader.join(_WAIT_S)
        for stream in (self._process.stdin, self._process.stdout):
            assert stream is not None
            stream.close()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line)

    def next(self, timeout_s: float = _WAIT_S) -> dict[str, Any]:
        """Return the next event; raise `queue.Empty` after a time without events."""
        event: dict[str, Any] = json.loads(self._lines.get(timeout=timeout_s))
        self.events.append(event)
        if event["event"] == "advertise":
            self.channels |= {one["topic"]: one for one in event["channels"]}
        if event["event"] == "advertiseServices":
            self.services |= {one["name"]: one for one in event["services"]}
        return event

    def until(self, name: str, **wanted: object) -> dict[str, Any]:
        """Return the next event of a name with these fields."""
        end_s = time.monotonic() + _WAIT_S
        while time.monotonic() < end_s:
            event = self.next()
            if event["event"] == name and wanted.items() <= event.items():
                return event
        raise AssertionError(f"no {name} with {wanted} in {self.events[-20:]}")

    def drain(self, for_s: float) -> list[dict[str, Any]]:
        """Return the events of a time."""
        end_s, before = time.monotonic() + for_s, len(self.events)
        while (left_s := end_s - time.monotonic()) > 0:
            try:
                self.next(left_s)
            except queue.Empty:
                break
        return self.events[before:]

    def ask(self, verb: str, **more: object) -> None:
        """Send a request to the client."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"do": verb, **more}) + "\n")
        self._process.stdin.flush()

    def subscribe(self, topic: str) -> int:
        """Subscribe to a known topic; return the id of the subscription."""
        self.ask("subscribe", channel=self.channels[topic]["id"])
        number: int = self.until("subscribed")["subscription"]
        return number

    def call(self, service: str, number: int, **request: object) -> dict[str, Any]:
        """Call a known service; return the response or the failure."""
        self.ask("call", service=self.services[service]["id"], call=number, request=request)
        end_s = time.monotonic() + _WAIT_S
        while time.monotonic() < end_s:
            event = self.next()
            if event["event"] == "response" and event["call"] == number:
                return event
            if event["event"] == "failure" and event["callId"] == number:
                return event
        raise AssertionError(f"no answer to {service} in {self.events[-20:]}")

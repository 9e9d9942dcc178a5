"""Alarms over the death of a server: judged with no page, acknowledged, killed, and still there."""

import json
import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx2
import pytest

from tests.e2e.keys import headers_for
from tests.e2e.processes import UrcProcess

Start = Callable[..., UrcProcess]

PROFILE = """\
urc: 1
kind: robot
name: cart
title: Cart
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: PORT
    framing: { type: delimiter, tx: LF, rx: LF }
signals:
  battery:
    unit: "%"
    limits: { low: 20, lolo: { at: 10, priority: high, action: Dock. }, hysteresis: 2 }
messages:
  level: { regex: '^LEVEL (?P<battery>[0-9]+)$' }
"""


class Cart:
    """A robot that tells its battery five times a second, to each client."""

    def __init__(self) -> None:
        self.level = 80
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.port = self._socket.getsockname()[1]
        self._is_over = threading.Event()
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._socket.accept()
            except OSError:
                return
            threading.Thread(target=self._tell, args=(client,), daemon=True).start()

    def _tell(self, client: socket.socket) -> None:
        with client:
            while not self._is_over.wait(0.2):
                try:
                    client.sendall(f"LEVEL {self.level}\n".encode())
                except OSError:
                    return

    def close(self) -> None:
        self._is_over.set()
        self._socket.close()


@pytest.fixture
def cart() -> Iterator[Cart]:
    made = Cart()
    yield made
    made.close()


class Served:
    """One run of the server, with no page and no program that watches the robot."""

    def __init__(self, start: Start, folder: Path, *options: str) -> None:
        data = str(folder / "data")
        self.process = start(
            "serve", str(folder / "cart.yaml"), "--port", "0", "--data-dir", data, *options
        )
        url = self.process.wait_for(r"^dashboard (http\S+)")[1]
        self._url, self._headers = url, headers_for(url)

    def get(self, path: str) -> dict[str, Any]:
        answer = httpx2.get(f"{self._url}api/v1/{path}", headers=self._headers, timeout=20)
        found: dict[str, Any] = answer.json()
        return found

    def post(self, path: str, body: dict[str, Any]) -> dict[str, Any]:
        url = f"{self._url}api/v1/{path}"
        found: dict[str, Any] = httpx2.post(
            url, headers=self._headers, json=body, timeout=20
        ).json()
        return found

    def alarms(self) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = self.get("robots/cart/alarms")["alarms"]
        return found

    def until(self, is_met: Callable[[list[dict[str, Any]]], bool]) -> list[dict[str, Any]]:
        end = time.monotonic() + 30
        while not is_met(found := self.alarms()):
            assert time.monotonic() < end, found
            time.sleep(0.05)
        return found


def written(cart: Cart, folder: Path) -> Path:
    (folder / "cart.yaml").write_text(PROFILE.replace("PORT", str(cart.port)))
    return folder


def test_an_acknowledgement_survives_kill_9(urc_process: Start, cart: Cart, tmp_path: Path) -> None:
    folder = written(cart, tmp_path)
    first = Served(urc_process, folder, "--monitor-alarms")
    cart.level = 15
    (alarm,) = first.until(bool)
    assert (alarm["state"], alarm["condition"]) == ("unacknowledged", "low")
    seen = {"alarms": {"battery": alarm["raised"]}}
    done = first.post("robots/cart/alarms/acknowledge", seen)
    assert done == {"signals": ["battery"], "stored": True}
    os.kill(first.process.pid, signal.SIGKILL)
    second = Served(urc_process, folder, "--monitor-alarms")
    (alarm,) = second.until(lambda found: bool(found) and found[0]["known"])
    assert alarm["state"] == "acknowledged"
    cart.level = 9
    (alarm,) = second.until(lambda found: found[0]["condition"] == "lolo")
    assert (alarm["state"], alarm["action"]) == ("unacknowledged", "Dock.")
    history = second.get("robots/cart/alarms/history")["events"]
    assert [one["kind"] for one in history[-2:]] == ["acknowledged", "raised"]


def test_without_the_option_no_robot_is_connected(
    urc_process: Start, cart: Cart, tmp_path: Path
) -> None:
    """A robot that takes one connection stays free for other programs."""
    cart.level = 15
    served = Served(urc_process, written(cart, tmp_path))
    time.sleep(2)
    assert served.alarms() == []
    state = served.get("robots/cart")["robot"]["state"]
    assert state == "idle"


def test_a_command_is_told_of_an_alarm_with_no_page(
    urc_process: Start, cart: Cart, tmp_path: Path
) -> None:
    folder = written(cart, tmp_path)
    told = folder / "told"
    (folder / "notify.yaml").write_text(
        f'command: [sh, -c, "cat >> {told}; echo >> {told}"]\npriority: high\n'
    )
    Served(urc_process, folder, "--monitor-alarms", "--notify-alarms", str(folder / "notify.yaml"))
    cart.level = 5
    end = time.monotonic() + 30
    while not (told.is_file() and told.read_text().endswith("\n")):
        assert time.monotonic() < end
        time.sleep(0.05)
    news = json.loads(told.read_text().splitlines()[0])
    assert (news["robot"], news["alarms"][0]["condition"]) == ("cart", "lolo")
    assert news["alarms"][0]["action"] == "Dock."

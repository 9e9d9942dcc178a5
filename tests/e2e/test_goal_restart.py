"""STOP after a restart of the server: the robot follows a goal that URC no longer knows."""

import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx2
import pytest

from tests.e2e.keys import headers_for
from tests.e2e.processes import UrcProcess

WAIT_S = 20.0
DOCKER = """\
urc: 1
kind: robot
name: docker
title: Docker
settings: { port: { type: port, default: 9090 } }
transports:
  ros: { type: ros, host: 127.0.0.1, port: "{{ settings.port }}", version: 2, stale_after: 2s }
signals:
  going: { type: boolean }
messages:
  state: { subscribe: { topic: /state, type: my_msgs/State }, json: { going: going } }
commands:
  drive:
    args: { speed: { type: number, min: -1, max: 1 } }
    send:
      publish:
        topic: /cmd_vel
        type: geometry_msgs/Twist
        json: { linear: { x: "{{ speed }}" } }
    hold: { repeat: 100ms, release: { speed: 0 } }
  dock:
    moves: true
    send: { goal: { action: /dock, type: my_msgs/action/Dock, json: {} } }
    reply: { json: { _docked: docked }, timeout: 60s }
  stop_docking: { stop: true, send: { cancel: { action: /dock } } }
simulator:
  signals: { going: false }
  ros:
    - name: go
      command: dock
      set: { going: true }
      then: [{ until: not going, answer: refused }]
    - { name: cancel, command: stop_docking, set: { going: false } }
    - { name: state, every: 100ms, message: state }
"""


@pytest.fixture
def start() -> Iterator[Callable[..., UrcProcess]]:
    processes: list[UrcProcess] = []

    def begin(*arguments: str) -> UrcProcess:
        processes.append(UrcProcess(arguments, {}))
        return processes[-1]

    yield begin
    for process in processes:
        process.kill()


class Server:
    """A server with the robot, and a program that uses it."""

    def __init__(self, process: UrcProcess) -> None:
        self.process = process
        address = process.wait_for(r"dashboard (http://\S+?/)$")[1]
        self.api = httpx2.Client(
            base_url=f"{address}api/v1/robots/docker/",
            headers=headers_for(address),
            timeout=WAIT_S,
            trust_env=False,
        )

    def until_going(self, is_going: bool) -> None:
        end_s = time.monotonic() + WAIT_S
        while True:
            told: Any = self.api.get("signals/going").json()
            if told.get("value") is is_going:
                return
            assert time.monotonic() < end_s, told
            time.sleep(0.1)


def test_stop_ends_a_goal_that_was_sent_before_the_server_was_killed(
    tmp_path: Path, start: Callable[..., UrcProcess]
) -> None:
    file = tmp_path / "docker.yaml"
    file.write_text(DOCKER)
    robot = start("simulate", str(file), "--set", "port=0")
    port = re.search(r":(\d+)", robot.wait_for(r"listening .*")[0])
    assert port is not None
    serve = ("serve", str(file), "--port", "0", "--set", f"port={port[1]}")
    data = ("--data-dir", str(tmp_path / "data"))
    first = Server(start(*serve, *data))
    with first.api, pytest.raises(httpx2.HTTPError):
        first.api.post("commands/dock", json={"arguments": {}}, timeout=2)
    first.process.kill()
    second = Server(start(*serve, *data))
    with second.api:
        second.until_going(True)
        assert second.api.post("stop").json()["latched"]
        second.until_going(False)
        end_s = time.monotonic() + WAIT_S
        while not second.api.post("stop").json()["confirmed"]:
            assert time.monotonic() < end_s, "the robot has answered, so STOP is confirmed"

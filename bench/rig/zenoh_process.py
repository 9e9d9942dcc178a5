"""A robot that is a Zenoh router: a separate program without imports from URC.

``python zenoh_process.py zenoh:127.0.0.1:0`` prints the same lines as `robot_process`, for one
robot. A value of the key ``go``, such as ``M 5``, is a line. The program ends when its standard
input closes.
"""

import contextlib
import json
import queue
import socket
import sys
import threading
import time
from typing import Any

import zenoh

BEAT_S = 0.005
LATE_S = 0.005


def _wait(ended: threading.Event) -> None:
    sys.stdin.read()
    ended.set()


def _free_port(host: str) -> int:
    with socket.socket() as line:
        line.bind((host, 0))
        return int(line.getsockname()[1])


def main(place: str) -> None:
    host, _, text = place.partition(":")[2].rpartition(":")
    port = int(text) or _free_port(host)
    said: queue.SimpleQueue[str] = queue.SimpleQueue()

    def heard(sample: Any) -> None:
        said.put(f"line 0 {time.monotonic_ns()} {sample.payload.to_string()}")

    settings = {
        "mode": "router",
        "listen": {"endpoints": [f"tcp/{host}:{port}"]},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"shared_memory": {"enabled": False}},
    }
    session = zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))
    session.declare_subscriber("go", zenoh.handlers.Callback(heard, indirect=False))
    print(f"ready {port}", flush=True)
    ended = threading.Event()
    threading.Thread(target=_wait, args=[ended], daemon=True).start()
    due_s = time.monotonic()
    while not ended.is_set():
        time.sleep(max(0.0, due_s - time.monotonic()))
        now_s = time.monotonic()
        if now_s - due_s > LATE_S:
            said.put(f"late {time.monotonic_ns()} {int((now_s - due_s) * 1e6)}")
        due_s = now_s + BEAT_S
        while not said.empty():
            print(said.get(), flush=True)


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt, BrokenPipeError):
        main(sys.argv[1])

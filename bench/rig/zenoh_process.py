"""A robot that is a Zenoh router: a separate program without imports from URC.

``python zenoh_process.py zenoh:127.0.0.1:0`` prints the same lines as `robot_process`, for one
robot. A value of the key ``go``, such as ``M 5``, is a line. An `Int64` on the ROS topic ``/go``
counts as the line ``M NUMBER``. The program also publishes the ROS topics ``/a`` to ``/e`` fifty
times a second, as rmw_zenoh does. The program ends when its standard input closes.
"""

import contextlib
import json
import queue
import socket
import struct
import sys
import threading
import time
from typing import Any

import zenoh
from zenoh.ext import Int64, z_serialize

BEAT_S = 0.005
DATA_S = 0.02
HASH = "RIHS01_8cd1048c2f186b6bd9a92472dc1ce51723c0833a221e2b7aecfff111774f4b49"
"""Hash of std_msgs/msg/Int64, as rosbags computes it."""
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

    def heard_ros(sample: Any) -> None:
        number = struct.unpack_from("<q", sample.payload.to_bytes(), 4)[0]
        said.put(f"line 0 {time.monotonic_ns()} M {number}")

    session.declare_subscriber("go", zenoh.handlers.Callback(heard, indirect=False))
    session.declare_subscriber("0/go/**", zenoh.handlers.Callback(heard_ros, indirect=False))
    print(f"ready {port}", flush=True)
    ended = threading.Event()
    threading.Thread(target=_wait, args=[ended], daemon=True).start()
    due_s = data_s = time.monotonic()
    count = 0
    while not ended.is_set():
        time.sleep(max(0.0, due_s - time.monotonic()))
        now_s = time.monotonic()
        if now_s - due_s > LATE_S:
            said.put(f"late {time.monotonic_ns()} {int((now_s - due_s) * 1e6)}")
        due_s = now_s + BEAT_S
        if now_s >= data_s:
            data_s, count = now_s + DATA_S, count + 1
            told = z_serialize((Int64(count), Int64(time.time_ns()), bytes(range(16))))
            for name in "abcde":
                key = f"0/{name}/std_msgs::msg::dds_::Int64_/{HASH}"
                session.put(key, b"\0\1\0\0" + struct.pack("<q", count), attachment=told)
        while not said.empty():
            print(said.get(), flush=True)


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt, BrokenPipeError):
        main(sys.argv[1])

"""A robot behind the Foxglove SDK's server: a separate program without imports from URC.

``python foxglove_process.py foxglove:127.0.0.1:0`` prints the same lines as `robot_process`, for
one robot. An `Int64` on the topic ``/go`` counts as the line ``M NUMBER``. The program also
publishes ``/beat`` ten times a second, and ``/a`` to ``/e`` fifty times. The program ends when its
standard input closes.
"""

import contextlib
import queue
import struct
import sys
import threading
import time
from typing import Any

import foxglove
from foxglove.websocket import Capability, ServerListener

BEAT_S = 0.005
DATA_S = 0.02
LATE_S = 0.005


class Robot(ServerListener):
    """Callbacks for the Foxglove SDK's server, which calls them in its own threads."""

    def __init__(self) -> None:
        self.said: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._motion: set[int] = set()

    def on_client_advertise(self, client: Any, channel: Any) -> None:
        if channel.topic == "/go":
            self._motion.add(channel.id)
            self.said.put(f"open 0 {time.monotonic_ns()}")

    def on_message_data(self, client: Any, client_channel_id: int, data: bytes) -> None:
        now_ns = time.monotonic_ns()
        if client_channel_id in self._motion:
            self.said.put(f"line 0 {now_ns} M {struct.unpack_from('<q', data, 4)[0]}")


def _wait(ended: threading.Event) -> None:
    sys.stdin.read()
    ended.set()


def main(place: str) -> None:
    host, _, port = place.partition(":")[2].rpartition(":")
    robot, context = Robot(), foxglove.Context()
    server = foxglove.start_server(
        name="robot",
        host=host,
        port=int(port),
        context=context,
        server_listener=robot,
        capabilities=[Capability.ClientPublish],
        supported_encodings=["cdr"],
    )
    schema = foxglove.Schema(name="std_msgs/msg/Int64", encoding="ros2msg", data=b"int64 data")
    beat = foxglove.Channel("/beat", message_encoding="cdr", schema=schema, context=context)
    data = [
        foxglove.Channel(f"/{name}", message_encoding="cdr", schema=schema, context=context)
        for name in "abcde"
    ]
    print(f"ready {server.port}", flush=True)
    ended = threading.Event()
    threading.Thread(target=_wait, args=[ended], daemon=True).start()
    due_s = beats_s = data_s = time.monotonic()
    while not ended.is_set():
        time.sleep(max(0.0, due_s - time.monotonic()))
        now_s = time.monotonic()
        if now_s - due_s > LATE_S:
            robot.said.put(f"late {time.monotonic_ns()} {int((now_s - due_s) * 1e6)}")
        due_s = now_s + BEAT_S
        if now_s >= beats_s:
            beats_s = now_s + 0.1
            beat.log(b"\0\1\0\0" + struct.pack("<q", time.time_ns()))
        if now_s >= data_s:
            data_s = now_s + DATA_S
            for one in data:
                one.log(b"\0\1\0\0" + struct.pack("<q", time.time_ns()))
        while not robot.said.empty():
            print(robot.said.get(), flush=True)
    server.stop()


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt, BrokenPipeError):
        main(sys.argv[1])

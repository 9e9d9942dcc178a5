"""The base of `ros_bases` on Zenoh, as a separate program: ``python -m … PORT PREFIX``.

The wheel provides the router, the publishers and the subscription; rosbags encodes the messages.
"""

import sys
import threading
import time

import zenoh
from zenoh.ext import Int64, z_serialize

from tests.e2e.transports.peers.zenoh import router_config
from tests.e2e.transports.ros_bases import STAMPED, messages
from tests.e2e.transports.ros_zenoh_robot import GID, Robot, say

EVERY_S = 0.05


def main() -> None:
    session = zenoh.open(router_config(int(sys.argv[1]), timestamping={"enabled": True}))
    robot = Robot(session, "jazzy")
    prefix = sys.argv[2]
    said = messages(prefix)
    keys = {topic: robot.token("MP", topic[1:], kind, "::,5:,:,:,,") for topic, (kind, _) in
            said.items()}  # fmt: skip
    robot.told(f"{prefix}/cmd_vel"[1:], STAMPED)
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    say(kind="ready")
    count = 0
    while not ended.wait(EVERY_S):
        count += 1
        told = z_serialize((Int64(count), Int64(time.time_ns()), GID))
        for topic, (_, data) in said.items():
            if topic.endswith(("/odom", "/scan")) or count % 10 == 0:
                session.put(keys[topic], data, attachment=told)


if __name__ == "__main__":
    main()

"""A drive with pymavlink, as a ground station does it. Prints one line of JSON.

Arguments: the port.
"""

import json
import os
import sys
import time
from collections.abc import Callable
from typing import Any

os.environ["MAVLINK20"] = "1"

from pymavlink import mavutil  # reads the environment when it is imported

WAIT_S = 45.0
HOLD = 4
MANUAL = 0


def main() -> None:
    link: Any = mavutil.mavlink_connection(
        f"tcp:127.0.0.1:{sys.argv[1]}", source_system=255, source_component=190
    )
    dialect = mavutil.mavlink

    def until(kind: str, is_so: Callable[[Any], bool] = lambda _: True) -> Any:
        end_s = time.monotonic() + WAIT_S
        while time.monotonic() < end_s:
            message = link.recv_match(type=kind, blocking=True, timeout=1)
            if message is not None and is_so(message):
                return message
        raise TimeoutError(kind)

    def ask(number: int, *values: float) -> int:
        given = [*values, *([0.0] * (7 - len(values)))]
        link.mav.command_long_send(1, 1, number, 0, *given)
        return int(until("COMMAND_ACK", lambda one: one.command == number).result)

    heartbeat = link.wait_heartbeat(timeout=WAIT_S)
    link.mav.heartbeat_send(dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, 4)
    found: dict[str, Any] = {"type": heartbeat.type, "autopilot": heartbeat.autopilot}
    found["manual"] = ask(dialect.MAV_CMD_DO_SET_MODE, 1, MANUAL)
    found["arm"] = ask(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    until("HEARTBEAT", lambda one: one.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
    yaw = until("ATTITUDE").yaw
    for _ in range(50):
        link.mav.manual_control_send(1, 500, 0, 500, 700, 0)
        message = until("ATTITUDE")
        if abs(message.yaw - yaw) > 0.05:
            break
    found["turned"] = abs(message.yaw - yaw)
    link.mav.manual_control_send(1, 0, 0, 500, 0, 0)
    until("ATTITUDE", lambda one: abs(one.yawspeed) < 0.02)
    found["hold"] = ask(dialect.MAV_CMD_DO_SET_MODE, 1, HOLD)
    until("HEARTBEAT", lambda one: one.custom_mode == HOLD)
    found["disarm"] = ask(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0)
    until("HEARTBEAT", lambda one: not one.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
    found["battery"] = until("SYS_STATUS").battery_remaining
    found["bad"] = link.mav.total_receive_errors
    sys.stdout.write(json.dumps(found) + "\n")


if __name__ == "__main__":
    main()

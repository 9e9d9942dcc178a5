"""A drive with pycreate2 over a serial line. Prints one line of JSON.

Arguments: the device.
"""

import contextlib
import io
import json
import os
import sys
import time
from typing import Any

from pycreate2 import Create2

WAIT_S = 45.0


def main() -> dict[str, Any]:
    robot: Any = Create2(sys.argv[1])
    robot.sleep_timer = 0.05  # it waits half a second after every byte
    robot.start()
    robot.safe()
    before = robot.get_sensors()
    robot.drive_direct(200, 200)
    end_s = time.monotonic() + WAIT_S
    now = robot.get_sensors()
    while now.encoder_counts_left == before.encoder_counts_left and time.monotonic() < end_s:
        time.sleep(0.1)
        now = robot.get_sensors()
    robot.drive_stop()
    return {
        "mode": before.open_interface_mode,
        "voltage": now.voltage,
        "ticks": now.encoder_counts_left - before.encoder_counts_left,
        "charge": now.battery_charge,
    }


if __name__ == "__main__":
    with contextlib.redirect_stdout(io.StringIO()):
        result = main()
    sys.stdout.write(json.dumps(result) + "\n")
    sys.stdout.flush()
    os._exit(0)  # its destructor waits for seconds

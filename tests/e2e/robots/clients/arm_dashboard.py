"""What ur_rtde's dashboard client asks an arm. Prints one line of JSON.

Arguments: the port.
"""

import json
import sys
import time
from typing import Any

from dashboard_client import DashboardClient

WAIT_S = 45.0


def main() -> None:
    arm: Any = DashboardClient("127.0.0.1", int(sys.argv[1]), False)
    arm.connect(int(WAIT_S * 1000))

    def until(ask: Any, wanted: str) -> str:
        end_s = time.monotonic() + WAIT_S
        said = ask()
        while wanted not in said and time.monotonic() < end_s:
            time.sleep(0.1)
            said = ask()
        return str(said)

    found: dict[str, Any] = {"connected": arm.isConnected()}
    arm.powerOn()
    arm.brakeRelease()
    found["mode"] = until(arm.robotmode, "RUNNING")
    arm.loadURP("weld.urp")
    found["loaded"] = arm.getLoadedProgram()
    arm.play()
    found["playing"] = until(arm.programState, "PLAYING")
    found["running"] = arm.running()
    arm.pause()
    found["paused"] = until(arm.programState, "PAUSED")
    arm.stop()
    found["stopped"] = until(arm.programState, "STOPPED")
    found["safety"] = arm.safetystatus()
    arm.popup("Mind the arm")
    arm.closePopup()
    arm.powerOff()
    found["off"] = until(arm.robotmode, "POWER_OFF")
    arm.disconnect()
    sys.stdout.write(json.dumps(found) + "\n")


if __name__ == "__main__":
    main()

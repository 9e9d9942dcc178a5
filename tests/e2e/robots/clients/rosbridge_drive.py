"""A short drive of one robot after the other with roslibpy. Prints one line of JSON.

Arguments: port of each, as ``name=port``. Runs as a process of its own: its event loop cannot be
started twice.
"""

import json
import logging
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import roslibpy

WAIT_S = 45.0


class Ears:
    """Keeps the newest message of each topic."""

    def __init__(self, ros: roslibpy.Ros) -> None:
        self._ros = ros
        self._news = threading.Condition()
        self._heard: dict[str, Any] = {}
        self._topics: list[roslibpy.Topic] = []

    def listen(self, topic: str, kind: str) -> None:
        def keep(message: Any) -> None:
            with self._news:
                self._heard[topic] = dict(message)
                self._news.notify_all()

        one = roslibpy.Topic(self._ros, topic, kind)
        one.subscribe(keep)
        self._topics.append(one)  # a topic that nobody holds is forgotten

    def until(self, topic: str, is_so: Callable[[Any], bool] = lambda _: True) -> Any:
        end_s = time.monotonic() + WAIT_S
        with self._news:
            while topic not in self._heard or not is_so(self._heard[topic]):
                left_s = end_s - time.monotonic()
                if left_s <= 0:
                    raise TimeoutError(f"{topic}: {self._heard.get(topic)}")
                self._news.wait(left_s)
            return self._heard[topic]


def driven(ros: roslibpy.Ros, expectations: Ears) -> dict[str, Any]:
    """Drive until it has moved, let go, and see that it stands."""
    expectations.listen("/odom", "nav_msgs/Odometry")
    before = expectations.until("/odom")["pose"]["pose"]["position"]
    drive = roslibpy.Topic(ros, "/cmd_vel", "geometry_msgs/Twist")

    def way(message: Any) -> float:
        at = message["pose"]["pose"]["position"]
        return abs(float(at["x"] - before["x"])) + abs(float(at["y"] - before["y"]))

    end_s = time.monotonic() + WAIT_S
    now = before
    while time.monotonic() < end_s:
        drive.publish(roslibpy.Message({"linear": {"x": 0.2}, "angular": {"z": 0.1}}))
        time.sleep(0.1)
        now = expectations.until("/odom")
        if way(now) > 0.02:
            break
    drive.publish(roslibpy.Message({"linear": {"x": 0}, "angular": {"z": 0}}))
    expectations.until("/odom", lambda message: message["twist"]["twist"]["linear"]["x"] == 0)
    drive.unadvertise()
    return {"way": way(now)}


def absolem(ros: roslibpy.Ros, expectations: Ears) -> dict[str, Any]:
    """Lift a flipper."""
    expectations.listen("/flippers_state", "nifti_robot_driver_msgs/FlippersStateStamped")
    expectations.listen("/robot_status", "nifti_robot_driver_msgs/RobotStatusStamped")
    lift = roslibpy.Topic(ros, "/flipper_cmd", "nifti_robot_driver_msgs/FlipperCommand")
    lift.publish(roslibpy.Message({"object_id": 3, "angle": 0.5}))
    flippers = expectations.until("/flippers_state", lambda one: abs(one["frontLeft"] - 0.5) < 0.01)
    return {"flipper": flippers["frontLeft"], "status": expectations.until("/robot_status")}


def turtlebot3(ros: roslibpy.Ros, expectations: Ears) -> dict[str, Any]:
    """Ask for a service, and for what others ask for, too."""
    power = roslibpy.Service(ros, "/motor_power", "std_srvs/SetBool")
    answer = power.call(roslibpy.ServiceRequest({"data": True}), timeout=WAIT_S)
    return {"power": dict(answer)["success"], "topics": ros.get_topics()}


MORE = {"absolem": absolem, "turtlebot3": turtlebot3}


def main() -> None:
    logging.getLogger("roslibpy").setLevel(logging.CRITICAL)
    found: dict[str, Any] = {}
    lines = []
    for argument in sys.argv[1:]:
        name, port = argument.split("=")
        ros = roslibpy.Ros("127.0.0.1", int(port))
        ros.run(WAIT_S)
        lines.append(ros)
        expectations = Ears(ros)
        found[name] = driven(ros, expectations)
        if name in MORE:
            found[name] |= MORE[name](ros, expectations)
        if name != "absolem":
            expectations.listen("/battery_state", "sensor_msgs/BatteryState")
            found[name]["battery"] = expectations.until("/battery_state")["percentage"]
        expectations.listen("/scan", "sensor_msgs/LaserScan")
        found[name]["beams"] = len(expectations.until("/scan")["ranges"])
    sys.stdout.write(json.dumps(found) + "\n")
    lines[0].terminate()


if __name__ == "__main__":
    main()

"""A dialogue of roslibpy, as its documentation shows it, with the bridge on the port given.

Runs as a process of its own: its event loop cannot be started twice. Prints one line of JSON.
"""

import json
import logging
import sys
import threading

import roslibpy

WAIT_S = 10.0


def main() -> None:
    logging.getLogger("roslibpy").setLevel(logging.CRITICAL)
    ros = roslibpy.Ros("127.0.0.1", int(sys.argv[1]))
    ros.run(WAIT_S)
    found: dict[str, object] = {"topics": ros.get_topics()}
    found["type"] = ros.get_topic_type("/odom")

    heard: dict[str, object] = {}
    events = {name: threading.Event() for name in ("/odom", "/echo", "result", "feedback")}

    def listen(name: str, kind: str, compression: str = "none") -> roslibpy.Topic:
        def keep(message: object) -> None:
            heard[name] = dict(message)  # type: ignore[call-overload]
            events[name].set()

        topic = roslibpy.Topic(ros, name, kind, compression=compression)
        topic.subscribe(keep)
        return topic

    listen("/odom", "nav_msgs/Odometry")
    echo = listen("/echo", "std_msgs/String")
    speaker = roslibpy.Topic(ros, "/echo", "std_msgs/String")
    speaker.publish(roslibpy.Message({"data": "grüezi / hello"}))
    assert events["/echo"].wait(WAIT_S), "no echo"
    echo.unsubscribe()

    drive = roslibpy.Topic(ros, "/cmd_vel", "geometry_msgs/Twist")
    drive.publish(roslibpy.Message({"linear": {"x": 0.5}}))
    assert events["/odom"].wait(WAIT_S), "no odometry"

    reset = roslibpy.Service(ros, "/reset", "std_srvs/Trigger")
    found["reset"] = dict(reset.call(roslibpy.ServiceRequest(), timeout=WAIT_S))
    unknown = roslibpy.Service(ros, "/nobody", "std_srvs/Trigger")
    try:
        unknown.call(roslibpy.ServiceRequest(), timeout=WAIT_S)
    except roslibpy.core.ServiceException as refused:
        found["unknown"] = str(refused)

    adder = roslibpy.Service(ros, "/add", "rospy_tutorials/AddTwoInts")

    def add(request: dict[str, int], response: dict[str, int]) -> bool:
        response["sum"] = request["a"] + request["b"]
        return True

    adder.advertise(add)
    other = roslibpy.Ros("127.0.0.1", int(sys.argv[1]))
    other.run(WAIT_S)
    asking = roslibpy.Service(other, "/add", "rospy_tutorials/AddTwoInts")
    request = roslibpy.ServiceRequest({"a": 20, "b": 22})
    found["sum"] = dict(asking.call(request, timeout=WAIT_S))["sum"]

    found["heard"] = heard
    sys.stdout.write(json.dumps(found) + "\n")
    ros.terminate()


if __name__ == "__main__":
    main()

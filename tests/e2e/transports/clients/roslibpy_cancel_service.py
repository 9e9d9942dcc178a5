"""A client of the bridge that offers the hidden service of the action /dock, by roslibpy.

Runs as a process of its own, because roslibpy's event loop cannot be started twice. Takes the port,
prints "ready", and then each request as one line of JSON. Each line of input is the next reply, as
JSON; null means that the service fails.
"""

import json
import logging
import sys
from typing import Any

import roslibpy

WAIT_S = 10.0


def tell(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main() -> None:
    logging.getLogger("roslibpy").setLevel(logging.CRITICAL)
    ros = roslibpy.Ros("127.0.0.1", int(sys.argv[1]))
    ros.run(WAIT_S)
    service = roslibpy.Service(ros, "/dock/_action/cancel_goal", "action_msgs/srv/CancelGoal")
    reply: list[dict[str, Any] | None] = [None]

    def handle(request: Any, response: Any) -> bool:
        tell(json.dumps(dict(request)))
        response.update(reply[0] or {})
        return reply[0] is not None

    service.advertise(handle)
    for line in sys.stdin:
        reply[0] = json.loads(line)
        tell("ready")
    ros.terminate()


if __name__ == "__main__":
    main()

"""The robot for `driver_poll` and `driver_flood`, in a separate, unmeasured process.

``python -m bench.driver_robot`` prints its port. The robot answers ``VEL …`` with an odometry line,
and ``FLOOD n`` with n mixed lines and ``OK n``. The process ends when its standard input closes.
"""

import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["LINES", "ODOMETRY", "robot"]

LINES = (
    b"BAT 24.31 87",
    b"ODO 1.250 -0.337 90.5",
    b"IMU 0.01 -0.02 9.81 0.001 0.002 -0.003",
    b"RNG 1.20 0.85",
)
ODOMETRY = LINES[1] + b"\n"


@contextmanager
def robot(*, is_beside: bool) -> Iterator[int]:
    """Run the robot inside a `with` block; yield the robot's port.

    Args:
        is_beside: whether to run the robot on the driver's processor, where the system supports
            this. On another processor, the robot's reply arrives sometimes before and sometimes
            after the driver goes to sleep. The benchmark would then measure wake-ups instead of the
            driver's work.
    """
    allowed = (
        os.sched_getaffinity(0) if is_beside and hasattr(os, "sched_getaffinity") else set[int]()
    )
    if allowed:
        os.sched_setaffinity(0, {min(allowed)})
    process = subprocess.Popen(
        [sys.executable, "-m", "bench.driver_robot"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    with process:
        try:
            assert process.stdout is not None
            yield int(process.stdout.readline())
        finally:
            process.kill()
            if allowed:
                os.sched_setaffinity(0, allowed)


def _serve(line: socket.socket) -> None:
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    left = b""
    with line:
        while data := line.recv(65536):
            *requests, left = (left + data).split(b"\n")
            for request in requests:
                if request.startswith(b"FLOOD "):
                    line.sendall(_flood(int(request[6:])))
                else:
                    line.sendall(ODOMETRY)


def _flood(count: int) -> bytes:
    lines = [LINES[place % len(LINES)] for place in range(count)]
    return b"\n".join([*lines, b"OK %d\n" % count])


def _main() -> None:
    listener = socket.create_server(("127.0.0.1", 0))
    print(listener.getsockname()[1], flush=True)

    def accept() -> None:
        while True:
            line, _ = listener.accept()
            threading.Thread(target=_serve, args=(line,), daemon=True).start()

    threading.Thread(target=accept, daemon=True).start()
    sys.stdin.read()  # ends with the parent process


if __name__ == "__main__":
    _main()

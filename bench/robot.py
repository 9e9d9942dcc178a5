"""A robot that sends a fixed text at a fixed rate: ``python -m bench.robot LINE TICKS RATE``.

`LINE` is the number of an inherited file descriptor, a socket. The robot starts when it receives
data, and closes the socket at the end.
"""

import socket
import sys
import time


def main() -> None:
    """Send the text `TICKS` times at the given rate."""
    number, ticks, rate_hz = sys.argv[1:]
    with socket.socket(fileno=int(number)) as line:
        line.recv(1)
        for _ in range(int(ticks)):
            time.sleep(1 / float(rate_hz))
            line.send(b"x")


if __name__ == "__main__":
    main()

"""Says something at a rate, and knows nothing: ``python -m bench.robot LINE TICKS RATE``.

`LINE` is the number of a socket that it was given. It begins when something comes there, and closes
it at the end.
"""

import socket
import sys
import time


def main() -> None:
    """Speak, until all is said."""
    number, ticks, rate_hz = sys.argv[1:]
    with socket.socket(fileno=int(number)) as line:
        line.recv(1)
        for _ in range(int(ticks)):
            time.sleep(1 / float(rate_hz))
            line.send(b"x")


if __name__ == "__main__":
    main()

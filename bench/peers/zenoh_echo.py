"""An echo over Zenoh alone, without URC, in three processes.

``python zenoh_echo.py router`` prints its port. ``python zenoh_echo.py echo PORT`` returns each
message with its time of arrival. ``python zenoh_echo.py send PORT`` sends the ordered number of
messages for each line on standard input. It then prints a JSON list of two times for each message
that came back: there, and there and back, in milliseconds. All connections use plain TCP. Each
program ends when its standard input closes.
"""

import json
import socket
import sys
import time
from typing import Any

import zenoh

PERIOD_NS = 20_000_000
SETTLE_S = 0.3
SIZE = 250
"""Size of a message in bytes, about that of a tick in TLS."""


def opened(mode: str, port: int) -> Any:
    """Return a session, without shared memory and without scouting."""
    place = [f"tcp/127.0.0.1:{port}"]
    settings = {
        "mode": mode,
        ("listen" if mode == "router" else "connect"): {"endpoints": place},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"shared_memory": {"enabled": False}},
    }
    return zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))


def publisher(session: Any, key: str) -> Any:
    """Return a publisher with the highest priority that drops messages rather than wait."""
    return session.declare_publisher(
        key,
        congestion_control=zenoh.CongestionControl.DROP,
        priority=zenoh.Priority.REAL_TIME,
    )


def route() -> None:
    """Route until standard input closes."""
    with socket.socket() as line:
        line.bind(("127.0.0.1", 0))
        port = line.getsockname()[1]
    session = opened("router", port)
    print("ready", port, flush=True)
    sys.stdin.read()
    session.close()


def echo(port: int) -> None:
    """Return messages until standard input closes."""
    session = opened("client", port)
    back = publisher(session, "back")

    def answer(sample: Any) -> None:
        back.put(f"{sample.payload.to_string()} {time.monotonic_ns()}")

    session.declare_subscriber("there", zenoh.handlers.Callback(answer, indirect=False))
    print("ready", port, flush=True)
    sys.stdin.read()
    session.close()


def send(port: int) -> None:
    """Send as ordered until standard input closes."""
    session = opened("client", port)
    there = publisher(session, "there")
    times: list[tuple[float, float]] = []

    def hear(sample: Any) -> None:
        now_ns = time.monotonic_ns()
        _, sent, came = sample.payload.to_string().split()
        times.append(((int(came) - int(sent)) / 1e6, (now_ns - int(sent)) / 1e6))

    session.declare_subscriber("back", zenoh.handlers.Callback(hear, indirect=False))
    print("ready", port, flush=True)
    for line in sys.stdin:
        times.clear()
        due_ns = time.monotonic_ns()
        for _ in range(int(line)):
            time.sleep(max(0.0, (due_ns - time.monotonic_ns()) / 1e9))
            there.put(f"{'x' * (SIZE - 21)} {time.monotonic_ns()}")
            due_ns += PERIOD_NS
        time.sleep(SETTLE_S)
        print(json.dumps(times), flush=True)
    session.close()


if __name__ == "__main__":
    if sys.argv[1] == "router":
        route()
    elif sys.argv[1] == "echo":
        echo(int(sys.argv[2]))
    else:
        send(int(sys.argv[2]))

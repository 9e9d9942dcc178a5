"""The rig itself: what it measures is so, and none of its programs outlives a test."""

import os
import socket
import sys
import time
from collections.abc import Iterator

import pytest

from urc.testing.rig import SERVER_ADDRESS, Operators, Program, Relay, Robots
from urc.testing.rig_relay import ports_of

pytestmark = pytest.mark.skipif("sys.platform != 'linux'", reason="the rig is for Linux")

SENDER = """
import socket, sys, time
line = socket.create_connection(({host!r}, {port}))
line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
for _ in range({count}):
    line.sendall(b"M %d\\n" % (time.monotonic_ns() // 1000))
    time.sleep(0.02)
print("sent")
sys.stdin.read()
"""


def ages_ms(robots: Robots) -> list[float]:
    """Return how old each value was when the first robot heard it."""
    return [(one.time_ns / 1000 - int(one.text[2:])) / 1000 for one in robots.heard[0]]


def test_robot_stamps_the_first_byte_of_each_line() -> None:
    """A line in two pieces has the time of the first one."""
    with Robots(["tcp:127.0.0.1:0"]) as robots:
        line = socket.create_connection(("127.0.0.1", robots.ports[0]))
        began_ns = time.monotonic_ns()
        line.sendall(b"HAL")
        time.sleep(0.1)
        line.sendall(b"LO\nAGAIN\r\n")
        robots.wait_until(lambda: len(robots.heard[0]) == 2, 5, "two lines")
        first, second = robots.heard[0]
        line.close()
        robots.wait_until(lambda: len(robots.visits[0]) == 2, 5, "the end of the line")
    assert [first.text, second.text] == ["HALLO", "AGAIN"]
    assert 0 <= first.time_ns - began_ns < second.time_ns - began_ns
    assert second.time_ns - first.time_ns >= 90_000_000
    assert [is_open for _, is_open in robots.visits[0]] == [True, False]


def test_robots_hear_datagrams_too() -> None:
    """Each is a line, whether it ends in one or not."""
    with Robots(["tcp:127.0.0.1:0", "udp:127.0.0.1:0"]) as robots:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            line.sendto(b"STOP", ("127.0.0.1", robots.ports[1]))
        robots.wait_until(lambda: bool(robots.heard[1]), 5, "a datagram")
    assert [one.text for one in robots.heard[1]] == ["STOP"]
    assert robots.heard[0] == []


def test_programs_end_with_whoever_started_them() -> None:
    """Also those that an operator has forked, and that are stopped."""
    with Robots(["tcp:127.0.0.1:0"]) as robots, Operators() as operators:
        # A page that reaches no dashboard fails, and says so.
        operators.start(
            {"number": 1, "host": "127.0.0.1", "port": robots.ports[0], "robot": "r",
             "death": "freeze", "drive_s": 0.1}
        )  # fmt: skip
        page = int(operators.await_told("pid", 1))
        os.kill(page, 0)
    assert not robots.is_running
    assert not operators.is_running
    assert not os.path.exists(f"/proc/{page}")


def test_program_that_says_nothing_is_told_with_what_it_said() -> None:
    """A wait has an end, and its failure shows the program's last lines."""
    with (
        Program([sys.executable, "-c", "print('hm')"]) as program,
        pytest.raises(AssertionError, match="a line with 'ready': not within 5 s; it said:\nhm"),
    ):
        program.wait_for("ready", 5)


@pytest.fixture
def relay() -> Iterator[Relay]:
    with Relay() as made:
        yield made


@pytest.fixture
def robots(relay: Relay) -> Iterator[Robots]:
    with Robots([f"tcp:{SERVER_ADDRESS}:0"], inside=relay.inside("b")) as made:
        yield made


def sender(relay: Relay, robots: Robots, count: int) -> Program:
    text = SENDER.format(host=SERVER_ADDRESS, port=robots.ports[0], count=count)
    return Program([sys.executable, "-c", text], inside=relay.inside("a"))


@pytest.mark.needs("tun")
def test_relay_delays_by_what_it_is_told(relay: Relay, robots: Robots) -> None:
    """50 ms one way."""
    relay.do("delay 50")
    with sender(relay, robots, 20) as program:
        program.wait_for("sent")
        robots.wait_until(lambda: len(robots.heard[0]) == 20, 5, "20 lines")
    ages = sorted(ages_ms(robots))
    assert ages[0] >= 50
    assert ages[10] < 60


@pytest.mark.needs("tun")
def test_cut_lets_nothing_through_until_it_heals(relay: Relay, robots: Robots) -> None:
    """And then the kernel delivers what it kept: the fault that URC must not have."""
    with sender(relay, robots, 40) as program:
        robots.wait_until(lambda: len(robots.heard[0]) >= 5, 5, "5 lines")
        cut_ns = relay.do("cut")
        program.wait_for("sent")
        time.sleep(0.2)
        assert [one for one in robots.heard[0] if one.time_ns > cut_ns + 20_000_000] == []
        relay.do("heal")
        robots.wait_until(lambda: len(robots.heard[0]) == 40, 10, "40 lines")
    assert max(ages_ms(robots)) > 400


@pytest.mark.needs("tun")
def test_ports_are_cut_one_by_one(relay: Relay, robots: Robots) -> None:
    """Another line goes on."""
    with sender(relay, robots, 5) as first:
        first.wait_for("sent")
        relay.do(f"cut {robots.ports[0]}")
        with (
            Robots([f"tcp:{SERVER_ADDRESS}:0"], inside=relay.inside("b")) as others,
            sender(relay, others, 5) as second,
        ):
            second.wait_for("sent")
            others.wait_until(lambda: len(others.heard[0]) == 5, 5, "5 lines")


@pytest.mark.needs("tun")
def test_interface_goes_down_and_up(relay: Relay, robots: Robots) -> None:
    """Nothing passes meanwhile; afterwards all does."""
    with sender(relay, robots, 30):
        robots.wait_until(lambda: len(robots.heard[0]) >= 3, 5, "3 lines")
        down_ns = relay.do("down a")
        time.sleep(0.3)
        assert [one for one in robots.heard[0] if one.time_ns > down_ns + 20_000_000] == []
        relay.do("up a")
        robots.wait_until(lambda: len(robots.heard[0]) == 30, 10, "30 lines")


@pytest.mark.needs("tun")
def test_loss_loses_packets(relay: Relay, robots: Robots) -> None:
    """TCP says them again, later."""
    relay.do("delay 5", "loss 30")
    with sender(relay, robots, 60) as program:
        program.wait_for("sent")
        # Each try that is lost doubles the wait before the next: it ends only where losses end.
        relay.do("loss 0")
        robots.wait_until(lambda: len(robots.heard[0]) == 60, 20, "60 lines")
    assert max(ages_ms(robots)) > 50


def test_ports_are_read_out_of_packets() -> None:
    """TCP and UDP over IPv4, options or not; anything else has none."""
    head = bytes([0x46, *[0] * 8, 17, *[0] * 10, 1, 1, 1, 1])
    assert ports_of(head + b"\x00\x50\x1f\x90") == (80, 8080)
    assert ports_of(bytes([0x45, *[0] * 8, 6, *[0] * 10]) + b"\x00\x50\x1f\x90rest") == (80, 8080)
    assert ports_of(bytes([0x45, *[0] * 8, 1, *[0] * 10]) + b"\x00\x50\x1f\x90") == (0, 0)
    assert ports_of(head) == (0, 0)
    assert ports_of(b"\x60" + bytes(60)) == (0, 0)

"""The rig itself: what it measures is so, and none of its programs outlives a test."""

import os
import socket
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from bench.processes import carried_bytes
from bench.rig.programs import SERVER_ADDRESS, Operators, Program, Relay, Robots
from bench.rig.relay_process import ports_of

pytestmark = [
    pytest.mark.skipif("sys.platform != 'linux'", reason="the rig is for Linux"),
]

SENDER = """
import select, socket, sys, time
line = socket.create_connection(({host!r}, {port}))
line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
count = 0
while not select.select([sys.stdin], [], [], 0.02)[0]:
    line.sendall(b"M %d\\n" % (time.monotonic_ns() // 1000))
    count += 1
    print("said", count, flush=True)
print("sent", count, flush=True)
sys.stdin.read()
"""
ARRIVE_S = 30.0
"""TCP says again what was lost, after a wait that doubles each time."""


def ages_ms(robots: Robots) -> list[float]:
    """Return how old each value was when the first robot heard it."""
    return [(one.time_ns / 1000 - int(one.text[2:])) / 1000 for one in robots.heard[0]]


def until_read(line: socket.socket) -> None:
    """Wait until whoever is at the other end of a connection on loopback has read everything."""
    ends = [f"{line.getsockname()[1]:04X}", f"{line.getpeername()[1]:04X}"]
    until = time.monotonic() + ARRIVE_S
    while True:
        rows = [row.split() for row in Path("/proc/net/tcp").read_text("ascii").splitlines()[1:]]
        left = {
            (row[1][-4:], row[2][-4:]): row[4]
            for row in rows
            if sorted((row[1][-4:], row[2][-4:])) == sorted(ends)
        }
        if len(left) == 2 and set(left.values()) == {"00000000:00000000"}:
            return
        assert time.monotonic() < until, f"it is not read: {left}"
        time.sleep(0.01)


def test_robot_stamps_the_first_byte_of_each_line() -> None:
    """A line in two pieces has the time of the first one."""
    with Robots(["tcp:127.0.0.1:0"]) as robots:
        line = socket.create_connection(("127.0.0.1", robots.ports[0]))
        began_ns = time.monotonic_ns()
        line.sendall(b"HAL")
        until_read(line)  # if it were read with what follows, the two times would be one
        line.sendall(b"LO\nAGAIN\r\n")
        robots.wait_until(lambda: len(robots.heard[0]) == 2, ARRIVE_S, "two lines")
        first, second = robots.heard[0]
        line.close()
        robots.wait_until(lambda: len(robots.visits[0]) == 2, ARRIVE_S, "the end of the line")
    assert [first.text, second.text] == ["HALLO", "AGAIN"]
    assert began_ns <= first.time_ns < second.time_ns
    assert [is_open for _, is_open in robots.visits[0]] == [True, False]


def test_robots_hear_datagrams_too() -> None:
    """Each is a line, whether it ends in one or not."""
    with Robots(["tcp:127.0.0.1:0", "udp:127.0.0.1:0"]) as robots:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            line.sendto(b"STOP", ("127.0.0.1", robots.ports[1]))
        robots.wait_until(lambda: bool(robots.heard[1]), ARRIVE_S, "a datagram")
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
        pytest.raises(AssertionError, match="a line with 'ready': not within 60 s; output:\nhm"),
    ):
        program.wait_for("ready", 60)  # it has ended long before


@pytest.fixture
def relay() -> Iterator[Relay]:
    with Relay() as made:
        yield made


@pytest.fixture
def robots(relay: Relay) -> Iterator[Robots]:
    with Robots([f"tcp:{SERVER_ADDRESS}:0"], inside=relay.inside("b")) as made:
        yield made


def sender(relay: Relay, robots: Robots) -> Program:
    """Return what sends lines until it is told something."""
    text = SENDER.format(host=SERVER_ADDRESS, port=robots.ports[0])
    return Program([sys.executable, "-c", text], inside=relay.inside("a"))


def until_heard(robots: Robots, count: int) -> None:
    """Wait until the first robot has heard so many lines."""
    robots.wait_until(lambda: len(robots.heard[0]) >= count, ARRIVE_S, f"{count} lines")


def until_said(program: Program, count: int) -> None:
    """Wait until so many more lines were sent."""
    before = len(program.lines)
    program.wait_until(
        lambda: len(program.lines) >= before + count, ARRIVE_S, f"{count} more lines to be sent"
    )


def end_sending(program: Program) -> int:
    """Let it send no more; return how many lines it has sent."""
    program.order("enough")
    return int(program.wait_for("sent")[1])


def sent_after(robots: Robots, time_ns: int) -> list[str]:
    """Return the lines that were sent later than that, and heard."""
    return [one.text for one in robots.heard[0] if int(one.text[2:]) * 1000 > time_ns]


@pytest.mark.needs("tun")
def test_relay_delays_by_what_it_is_told(relay: Relay, robots: Robots) -> None:
    """50 ms one way."""
    relay.do("delay 50")
    with sender(relay, robots):
        until_heard(robots, 20)
    assert 50 <= min(ages_ms(robots)) < 100


@pytest.mark.needs("tun")
def test_cut_lets_nothing_through_until_it_heals(relay: Relay, robots: Robots) -> None:
    """And then the kernel delivers what it kept: the fault that URC must not have."""
    with sender(relay, robots) as program:
        until_heard(robots, 5)
        cut_ns = relay.do("cut")
        until_said(program, 30)
        count = end_sending(program)
        assert sent_after(robots, cut_ns) == []
        heal_ns = time.monotonic_ns()
        relay.do("heal")
        until_heard(robots, count)
    late = [one for one in robots.heard[0] if int(one.text[2:]) * 1000 > cut_ns]
    assert len(late) >= 20
    assert min(one.time_ns for one in late) > heal_ns


@pytest.mark.needs("tun")
def test_ports_are_cut_one_by_one(relay: Relay, robots: Robots) -> None:
    """Another line goes on."""
    with sender(relay, robots):
        until_heard(robots, 5)
        cut_ns = relay.do(f"cut {robots.ports[0]}")
        with (
            Robots([f"tcp:{SERVER_ADDRESS}:0"], inside=relay.inside("b")) as others,
            sender(relay, others),
        ):
            until_heard(others, 5)
        assert sent_after(robots, cut_ns) == []


@pytest.mark.needs("tun")
def test_interface_goes_down_and_up(relay: Relay, robots: Robots) -> None:
    """Nothing passes meanwhile; afterwards all does."""
    with sender(relay, robots) as program:
        until_heard(robots, 3)
        down_ns = relay.do("down a")
        until_said(program, 15)
        assert sent_after(robots, down_ns) == []
        relay.do("up a")
        until_heard(robots, end_sending(program))


@pytest.mark.needs("tun")
def test_loss_loses_packets(relay: Relay, robots: Robots) -> None:
    """TCP says them again, later."""
    relay.do("delay 5", "loss 30")
    with sender(relay, robots) as program:
        robots.wait_until(lambda: any(age > 50 for age in ages_ms(robots)), ARRIVE_S, "a late line")
        # Each try that is lost doubles the wait before the next: it ends only where losses end.
        relay.do("loss 0")
        until_heard(robots, end_sending(program))


@pytest.mark.needs("tun")
def test_a_relay_with_three_sides_delivers_to_the_address() -> None:
    """No packet from the first side to the second reaches the third."""
    with Relay("abc") as relay:
        places = [f"tcp:10.77.0.{number}:0" for number in (2, 3)]
        with (
            Robots(places[:1], inside=relay.inside("b")) as second,
            Robots(places[1:], inside=relay.inside("c")) as third,
            sender(relay, second),
        ):
            until_heard(second, 5)
            assert carried_bytes(second.pid, "tun0")[0] > 0
            assert carried_bytes(third.pid, "tun0")[0] == 0


def test_ports_are_read_out_of_packets() -> None:
    """TCP and UDP over IPv4, options or not; anything else has none."""
    head = bytes([0x46, *[0] * 8, 17, *[0] * 10, 1, 1, 1, 1])
    assert ports_of(head + b"\x00\x50\x1f\x90") == (80, 8080)
    assert ports_of(bytes([0x45, *[0] * 8, 6, *[0] * 10]) + b"\x00\x50\x1f\x90rest") == (80, 8080)
    assert ports_of(bytes([0x45, *[0] * 8, 1, *[0] * 10]) + b"\x00\x50\x1f\x90") == (0, 0)
    assert ports_of(head) == (0, 0)
    assert ports_of(b"\x60" + bytes(60)) == (0, 0)

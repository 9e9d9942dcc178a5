"""`urc watch`, `urc simulate` and `urc send` as people run them: real processes and sockets."""

import fcntl
import json
import re
import signal
import socket
import subprocess
import sys
import termios
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.command_line import (
    BOT,
    PUPPET,
    TIMEOUT_S,
    URC,
    at,
    program,
    run,
    wait_for_listener,
)
from tests.e2e.ports import free_port
from tests.e2e.processes import ROOT, UrcProcess

Start = Callable[..., UrcProcess]


def values_of(lines: list[str]) -> list[tuple[str, object]]:
    return [(line["signal"], line["value"]) for line in map(json.loads, lines)]


# -- watch


@pytest.mark.needs("socat")
def test_watch_reads_a_program_of_others_once_a_second(urc_process: Start, tmp_path: Path) -> None:
    """It reads a line, answers a number, never closes the connection: a value for each question."""
    port, asked = free_port(), tmp_path / "asked"
    script = tmp_path / "answer.sh"
    script.write_text(
        f'read line; [ -n "$line" ] || exit; echo "$line" >> {asked}; wc -l < {asked}; sleep 60\n'
    )
    listen = f"TCP-LISTEN:{port},bind=127.0.0.1,reuseaddr,fork"
    with program("socat", listen, f"EXEC:sh {script}"):
        wait_for_listener(port)
        watch = urc_process("watch", PUPPET, "--set", f"port={port}")
        watch.wait_for('"battery"', times=5)
        assert watch.interrupt() == 130
    values = values_of(watch.output)
    assert values == [("battery", number) for number in range(1, len(values) + 1)]
    times = [json.loads(line)["t"] for line in watch.output]
    assert times == sorted(times)
    assert times[4] - times[0] > 2, "it asks once a second, not all the time"
    assert set(asked.read_text().splitlines()) == {"Give me the battery %"}


def test_watch_follows_a_robot_that_dies_and_comes_back(urc_process: Start) -> None:
    """Nobody does anything; what happens is told on standard error."""
    port = f"port={free_port()}"
    robot = urc_process("simulate", PUPPET, "--set", port)
    robot.wait_for("listening")
    watch = urc_process("watch", PUPPET, "battery", "--set", port)
    watch.wait_for('"battery"')
    robot.kill()
    watch.wait_for(r"^warning: transport wire: lost: nothing listens")
    before = len(watch.output)
    urc_process("simulate", PUPPET, "--set", port).wait_for("listening")
    watch.wait_for('"battery"', times=before + 1)
    watch.wait_for(r"^info: transport wire: live$", times=2)
    assert watch.interrupt() == 130
    assert not [line for line in watch.errors if "Traceback" in line]


def test_watch_shows_the_wire(urc_process: Start) -> None:
    """Bytes both ways, in the order in which they went, around the value they carry."""
    robot = urc_process("simulate", PUPPET, "--set", "port=0")
    port = robot.wait_for(r"listening wire tcp 127\.0\.0\.1:(\d+)$")[1]
    watch = urc_process("watch", PUPPET, "--set", f"port={port}", "--for", "5s", "--wire")
    assert watch.wait() == 0
    sent, received, value = map(json.loads, watch.output[:3])
    question = "Give me the battery %\n"
    assert (sent["direction"], sent["text"]) == ("sent", question)
    assert sent["hex"] == question.encode().hex(" ")
    assert (received["direction"], received["text"]) == ("received", f"{value['value']}\n")
    assert list(sent) == list(received) == ["t", "transport", "direction", "hex", "text"]
    assert list(value)[:3] == ["t", "signal", "value"]


def test_watch_of_a_robot_that_is_not_there_fails_with_the_reason(urc_process: Start) -> None:
    """1, and a last line that says what to look at."""
    port = free_port()
    watch = urc_process("watch", PUPPET, "--set", f"port={port}", "--for", "300ms")
    assert watch.wait() == 1
    assert watch.output == []
    assert watch.errors[-1] == (
        "urc watch: nothing was received from puppet:"
        f" nothing listens on 127.0.0.1:{port} (connection refused)"
    )


def test_watch_ends_with_its_reader(urc_process: Start) -> None:
    """`urc watch … | head -1` is no failure."""
    robot = urc_process("simulate", PUPPET, "--set", "port=0")
    port = robot.wait_for(r"listening wire tcp 127\.0\.0\.1:(\d+)$")[1]
    watch = subprocess.Popen(
        [*URC, "watch", PUPPET, "--set", f"port={port}"],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert watch.stdout is not None
    assert json.loads(watch.stdout.readline())["signal"] == "battery"
    watch.stdout.close()
    _, errors = watch.communicate(timeout=TIMEOUT_S)
    assert watch.returncode == 0
    assert b"Traceback" not in errors


@pytest.mark.needs("socat")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_watch_whose_reader_stands_still_can_be_ended(number: signal.Signals, bot: str) -> None:
    """The pipe is full, the robot talks on; a signal ends it all the same."""
    port = free_port()
    with program("socat", f"TCP-LISTEN:{port},bind=127.0.0.1,reuseaddr,fork", "SYSTEM:yes s 1"):
        wait_for_listener(port)
        watch = subprocess.Popen(
            [*URC, "watch", bot, *at(port)],
            cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        assert watch.stdout is not None
        try:
            wait_until_full(watch.stdout.fileno())
            watch.send_signal(number)
            assert watch.wait(TIMEOUT_S) == 128 + number
        finally:
            watch.kill()
            watch.stdout.close()


def wait_until_full(pipe: int) -> None:
    """Return when what waits in a pipe has stopped growing."""
    deadline, before = time.monotonic() + TIMEOUT_S, -1
    while True:
        waiting = int.from_bytes(fcntl.ioctl(pipe, termios.FIONREAD, b"\0" * 4), sys.byteorder)
        if waiting and waiting == before:
            return
        assert time.monotonic() < deadline
        before = waiting
        time.sleep(0.2)


# -- simulate


@pytest.mark.needs("netcat")
def test_simulated_robot_answers_netcat(urc_process: Start) -> None:
    """The thesis's emulated robot, for a client that is not URC."""
    robot = urc_process("simulate", PUPPET, "--set", "port=0")
    port = robot.wait_for(r"^listening wire tcp 127\.0\.0\.1:(\d+)$")[1]
    answer = subprocess.run(
        ["nc", "127.0.0.1", port],
        input=b"Give me the battery %\n", stdout=subprocess.PIPE, timeout=TIMEOUT_S, check=True,
    ).stdout  # fmt: skip
    assert re.fullmatch(rb"\d{1,2}\n", answer)
    assert robot.interrupt() == 0
    assert robot.errors == []


def test_port_in_use_is_one_line(urc_process: Start) -> None:
    """The person who starts it twice reads which port and why."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        robot = urc_process("simulate", PUPPET, "--set", f"port={port}")
        dashboard = urc_process("serve", PUPPET, "--port", str(port))
        assert (robot.wait(), dashboard.wait()) == (1, 1)
    assert (robot.output, dashboard.output) == ([], [])
    assert robot.errors == [
        f"urc simulate: transports.wire: cannot listen on 127.0.0.1:{port} (address already in use)"
    ]
    (line,) = dashboard.errors
    assert line.startswith(f"urc serve: cannot listen on 127.0.0.1 port {port}: ")


def test_simulated_robot_needs_no_settings(urc_process: Start, tmp_path: Path) -> None:
    """Not those of the real robot, and a port is found for it; without rules it answers too."""
    plain = tmp_path / "plain.yaml"
    plain.write_text(BOT.partition("simulator:")[0], encoding="utf-8")
    robot = urc_process("simulate", str(plain))
    port = robot.wait_for(r"^listening wire tcp 127\.0\.0\.1:(\d+)$")[1]
    assert int(port) >= 1024
    assert run("send", str(plain), "ask", *at(port)).returncode == 0
    assert robot.interrupt() == 0
    assert robot.errors == []


def test_simulated_robot_tells_what_it_cannot_answer(urc_process: Start) -> None:
    """Once at once, the rest counted; what is known is answered all the while."""
    robot = urc_process("simulate", PUPPET, "--set", "port=0")
    port = int(robot.wait_for(r"^listening wire tcp 127\.0\.0\.1:(\d+)$")[1])
    for _ in range(3):
        with socket.create_connection(("127.0.0.1", port), timeout=TIMEOUT_S) as client:
            client.sendall(b"Give me the batery %\nGive me the battery %\n")
            assert re.fullmatch(rb"\d{1,2}\n", client.recv(100))
    assert robot.interrupt() == 0
    complaint = (
        "transport wire: no rule matches 'Give me the batery %', and the driver never sends it"
    )
    assert robot.errors == [complaint, f"{complaint} (2 more times)"]


def test_simulated_robot_hangs_up_where_a_rule_says_so(urc_process: Start, tmp_path: Path) -> None:
    """What it said before is on its way first, the answer that waits included."""
    rude = tmp_path / "rude.yaml"
    then = "[{ after: 100ms, send: bye, close: true }]"
    rules = f"simulator:\n  wire: [{{ match: '^quit$', send: bye, then: {then} }}]\n"
    rude.write_text(BOT.partition("simulator:")[0] + rules, encoding="utf-8")
    robot = urc_process("simulate", str(rude))
    port = int(robot.wait_for(r"^listening wire tcp 127\.0\.0\.1:(\d+)$")[1])
    with socket.create_connection(("127.0.0.1", port), timeout=TIMEOUT_S) as client:
        client.sendall(b"quit\n")
        assert client.makefile("rb").read() == b"bye\nbye\n"
    assert robot.interrupt() == 0


# -- send


def test_send_prints_the_reply(urc_process: Start, bot: str) -> None:
    """As JSON, on one line."""
    robot = urc_process("simulate", bot)
    port = robot.wait_for(r"listening .*:(\d+)$")[1]
    done = run("send", bot, "ask", *at(port))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == '{"command": "ask", "values": {"speed": 7}}\n'


@pytest.mark.parametrize("connection", ["persistent", "per_request"])
def test_send_without_a_reply_writes_all_its_bytes(
    connection: str, urc_process: Start, tmp_path: Path
) -> None:
    """Nothing is answered, and still the bytes are out before the process ends."""
    file = tmp_path / "bot.yaml"
    text = BOT.replace("    framing:", f"    connection: {connection}\n    framing:")
    file.write_text(text, encoding="utf-8")
    with socket.create_server(("127.0.0.1", 0)) as robot:
        robot.settimeout(TIMEOUT_S)
        send = urc_process("send", str(file), "set_speed", "speed=3", *at(robot.getsockname()[1]))
        line, _ = robot.accept()
        with line:
            line.settimeout(TIMEOUT_S)
            heard = b""
            while piece := line.recv(100):
                heard += piece
        assert send.wait() == 0
    assert heard == b"speed 3\n"
    assert send.output == ['{"command": "set_speed", "values": {}}']


def test_send_that_fails_tells_why(bot: str) -> None:
    """A robot that is not there is a failure, a wrong argument is wrong use."""
    port = free_port()
    done = run("send", bot, "ask", *at(port))
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == (
        "urc send: ask failed (disconnected): the robot is not connected:"
        f" nothing listens on 127.0.0.1:{port} (connection refused)\n"
    )
    done = run("send", bot, "set_speed", "speed=10", *at(port))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "urc send: set_speed failed (bad-argument): speed: 10 is above its maximum 9\n"
    )
    done = run("send", bot, "ask")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "urc send: bot needs host, port: add --set host=… --set port=…\n"


def test_send_to_a_robot_that_does_not_answer_ends(bot: str) -> None:
    """After the reply's own time-out."""
    Path(bot).write_text(BOT.replace("timeout: 20s", "timeout: 500ms"), encoding="utf-8")
    with socket.create_server(("127.0.0.1", 0)) as robot:
        done = run("send", bot, "ask", *at(robot.getsockname()[1]))
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == "urc send: ask failed (timed-out): no answer to ask within 0.5 s\n"


def test_send_waits_for_what_the_command_requires(urc_process: Start, bot: str) -> None:
    """The poll that reads it goes out first; its answer counts."""
    text = BOT.replace(
        "commands:\n",
        "commands:\n  go: { send: ask, requires: [{ expr: speed > 1, else: Too slow }] }\n",
    )
    text += "polls:\n  - { run: ask, every: 500ms }\n"
    Path(bot).write_text(text, encoding="utf-8")
    robot = urc_process("simulate", bot)
    port = robot.wait_for(r"listening .*:(\d+)$")[1]
    done = run("send", bot, "go", *at(port))
    assert (done.returncode, done.stderr) == (0, "")

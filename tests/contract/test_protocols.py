"""Protocols of many kinds, written as drivers out of public documents and nothing else.

Each file in `tests/protocols` carries its own tests, with the bytes of its document. The emulated
robot is made by the same file: both sides speak with each other here, joined by bytes alone.
"""

import os
from collections import deque
from pathlib import Path

import pytest

from tests.contract.profiles import profile_of
from urc.model.profile import Profile
from urc.model.values import Value
from urc.problems import to_text
from urc.protocol.engine import Engine
from urc.protocol.events import (
    Close,
    Event,
    Failed,
    Open,
    Replied,
    Request,
    Samples,
    Send,
    Violation,
)
from urc.runtime.coverage import measure
from urc.runtime.document_tests import exercise, sample_settings
from urc.simulator.emulated_robot import EmulatedConnection, EmulatedRobot

FILES = sorted((Path(__file__).parents[1] / "protocols").glob("*.yaml"))
SHORTEST_S, LONGEST_S = 2.0, 30.0
"""How long the emulated robot is listened to: twice the slowest poll, within these."""
STEP_S = 0.05


@pytest.fixture(params=FILES, ids=lambda file: file.stem)
def file(request: pytest.FixtureRequest) -> Path:
    """The document of one protocol."""
    path: Path = request.param
    return path


def test_there_are_protocols_of_many_kinds() -> None:
    """Twelve, as the issue of the language asks for."""
    assert len(FILES) >= 12


def test_its_own_tests_pass_and_leave_nothing_out(file: Path) -> None:
    """No finding, and every command, poll and message is exercised."""
    profile = profile_of(file)
    outcome = exercise(profile)
    assert [to_text(problem) for problem in outcome.problems] == []
    assert measure(os.fspath(file), profile.driver, outcome.exercised).untested == ()


class Conversation:
    """An engine and the emulated robot of the same document."""

    def __init__(self, profile: Profile) -> None:
        optional = {name: True for name, one in profile.settings.items() if one.type == "boolean"}
        settings = {**sample_settings(profile.settings), **optional}
        self.profile = profile
        self.now = 0.0
        self.engine = Engine(profile.driver, settings)
        self.emulated_robot = EmulatedRobot(profile, settings)
        self.lines: dict[str, EmulatedConnection] = {}
        self.read: set[str] = set()
        """Signals that had a value."""
        self.last: dict[str, object] = {}
        """Newest value of each signal."""
        self.faults: list[str] = []
        self.done: list[str] = []
        """Commands that succeeded."""
        self.said: deque[tuple[str, bytes]] = deque()
        """Frames of the robot that are on their way."""

    def begin(self) -> None:
        """Let every line that stays open be connected."""
        self.perform(self.engine.tick(self.now))
        for name, spec in self.profile.driver.transports.items():
            if spec.connection == "persistent":
                self.connect(name)

    def connect(self, transport: str) -> None:
        """Let a line be connected to a robot that knows nothing of earlier connections."""
        self.lines[transport] = self.emulated_robot.line(transport)
        self.perform(self.engine.start(transport, self.now))

    def perform(self, events: list[Event]) -> None:
        """Do what a link would do; answers come in the order in which they are asked for."""
        pending = deque(events)
        while pending:
            match pending.popleft():
                case Send(transport, data):
                    for answer in self.lines[transport].receive(data, self.now):
                        self.said.append((transport, answer))
                case Open(transport):
                    self.connect(transport)
                case Close(transport, reason):
                    if reason:
                        self.faults.append(f"closed {transport}: {reason}")
                    del self.lines[transport]
                case Samples(_, samples):
                    self.read |= {one.signal for one in samples if one.value is not None}
                    self.last |= {one.signal: one.value for one in samples}
                case Replied(_, command, _):
                    self.done.append(command)
                case Violation(_, code, message) | Failed(_, _, code, message):
                    self.faults.append(f"{code}: {message}")
            if not pending and self.said:
                transport, answer = self.said.popleft()
                pending.extend(self.engine.receive(transport, answer, self.now))

    def wait(self, seconds: float) -> None:
        """Let time pass on both sides."""
        end = self.now + seconds
        while self.now < end:
            self.now += STEP_S
            for transport, line in tuple(self.lines.items()):
                for said in line.advance(STEP_S, self.now):
                    if self.lines.get(transport) is line:
                        self.perform(self.engine.receive(transport, said, self.now))
            deadline = self.engine.deadline
            if deadline is not None and deadline <= self.now:
                self.perform(self.engine.tick(self.now))


def test_the_emulated_robot_answers_its_polls(file: Path) -> None:
    """Greetings, logins, polls and messages, without a rule for a single one of them."""
    profile = profile_of(file)
    driver = profile.driver
    slowest_s = max((poll.every_s + poll.phase_s for poll in driver.polls), default=0.0)
    talk = Conversation(profile)
    talk.begin()
    talk.wait(min(LONGEST_S, max(SHORTEST_S, 2 * slowest_s)))
    refused = {name: line.last_fault for name, line in talk.lines.items() if line.faults}
    assert (talk.faults[:5], refused) == ([], {})
    reads = {f"poll {poll.name}": poll.reply.read for poll in driver.polls if poll.reply}
    reads |= {f"message {name}": message.read for name, message in driver.messages.items()}
    for name, read in reads.items():
        told = {field for field in read.fields if field in driver.signals}
        assert not told or told & talk.read, f"nothing of {name} was said"


def test_the_emulated_robot_answers_its_commands(file: Path) -> None:
    """With the arguments of the document's own tests; what they require and verify comes true."""
    profile = profile_of(file)
    commands = profile.driver.commands
    talk = Conversation(profile)
    talk.begin()
    talk.wait(SHORTEST_S)
    for test in profile.tests:
        command = commands.get(test.run or "")
        if command is None or test.fails is not None:
            continue
        request = Request(1, command.name, test.arguments)
        talk.perform(talk.engine.command(request, talk.now))
        talk.wait(1.0)
        assert talk.faults == []
        assert talk.done[-1:] == [command.name], f"test {test.name!r}"


def ready(name: str, **greetings: bytes) -> Engine:
    """Return the engine of a protocol whose lines are connected and have heard `greetings`."""
    profile = profile_of(Path(__file__).parents[1] / "protocols" / f"{name}.yaml")
    polls = tuple(poll._replace(phase_s=999.0) for poll in profile.driver.polls)
    engine = Engine(profile.driver._replace(polls=polls), sample_settings(profile.settings))
    engine.tick(0.0)
    for transport in profile.driver.transports:
        engine.start(transport, 0.0)
    for transport, data in greetings.items():
        engine.receive(transport, data, 0.0)
    return engine


def sent(events: list[Event]) -> bytes:
    """Return all that goes out."""
    return b"".join(event.data for event in events if isinstance(event, Send))


def test_grbl_takes_a_realtime_byte_while_it_homes() -> None:
    """A feed hold waits for no `ok`, has no terminator, and takes no room in the buffer."""
    engine = ready("grbl")
    assert sent(engine.command(Request(1, "home"), 1.0)) == b"$H\n"
    assert sent(engine.command(Request(2, "unlock"), 1.0)) == b"$X\n"
    assert sent(engine.command(Request(3, "hold"), 1.0)) == b"!"
    assert sent(engine.receive("serial", b"ok\r\n", 2.0)) == b""


def test_sticks_of_the_tello_wait_for_no_answer() -> None:
    """Neither for a move at work, nor for its lost answer; let go, they are in the middle."""
    engine = ready("tello", control=b"ok", state=b"bat:80;\r\n")
    move: dict[str, Value] = {"direction": "up", "distance": 50}
    assert sent(engine.command(Request(1, "move", move), 0.2)) == b"up 50"
    for place, forward in enumerate((10, 20, 30)):
        request = Request(2, "fly", {"forward": forward})
        assert sent(engine.command(request, 0.3 + place / 20)) == b"rc 0 %d 0 0" % forward
    assert engine.motions.stop_frame("fly") == b"rc 0 0 0 0"


def test_answers_of_the_dashboard_are_told_apart_between_each_other() -> None:
    """Three requests are on their way; a refusal in the midst is that of the one it answers."""
    engine = ready("ur-dashboard", dashboard=b"Connected: Universal Robots Dashboard Server\n")
    for number, command in enumerate(("robot_mode", "pause", "close_popup")):
        assert sent(engine.command(Request(number, command), 0.1)) != b""
    answers = b"Robotmode: IDLE\nFailed to execute: pause\nclosing popup\n"
    ends = [
        (event.id, isinstance(event, Replied))
        for event in engine.receive("dashboard", answers, 0.2)
        if isinstance(event, (Replied, Failed))
    ]
    assert ends == [(0, True), (1, False), (2, True)]

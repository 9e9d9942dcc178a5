"""Whatever is told to an engine, in whatever order: nothing raises, grows, hangs or is lost."""

from typing import Any

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
)

from tests.dialogue import driver_of
from tests.effort import examples
from urc.protocol.engine import Engine
from urc.protocol.events import Close, Event, Failed, Open, Replied, Request

DRIVER = driver_of(
    """
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 6789
    framing: { type: delimiter, tx: LF, rx: LF, max: 40 }
    timeouts: { connect: 1s, reply: 500ms }
    min_gap: 10ms
    queue: { in_flight: 2, depth: 5 }
    keepalive: { every: 700ms, run: ping }
    on_connect: [{ prompt: '> $', else: [{ expect: '^HI$' }] },
        { send: "KEY {{ seq('k', 0, 3) }}", redact: true }, { run: ping }]
    on_close: [{ send: BYE }, { expect: '^BYE$' }]
    stale_after: 2s
  call:
    type: tcp
    host: 127.0.0.1
    port: 6790
    connection: per_request
    framing: { type: delimiter, tx: LF, rx: LF }
    timeouts: { connect: 1s, reply: 300ms }
    queue: { depth: 4 }
    on_connect: [{ expect: '^HI$' }]
    on_close: [{ send: BYE }]
signals: { a: { type: integer, min: 0, max: 50, stale_after: 1s }, b: { type: string } }
commands:
  ping: { to: wire, send: PING, reply: { equals: PONG }, idempotent: true, retries: 2 }
  get:
    to: wire
    send: "{{ id }} {{ seq('n', 0, 3) }}"
    args: { id: { type: integer } }
    reply: { regex: '^(?P<_id>\\d+)=(?P<a>\\d+)$', match: _id == id, errors: ['^ERR'] }
    verify: { expr: a > 3, within: 1s }
  now: { to: wire, send: NOW, priority: realtime, reply: { regex: '^<(?P<b>.*)>$' } }
  move: { to: wire, send: "MOVE {{ id }}", args: { id: { type: integer } }, coalesce: latest,
      rate_limit: 5/s }
  lines: { to: wire, send: LINES, reply: { regex: '(?s)A.*B', lines: { until: '^END' } },
      requires: [{ expr: a > 5, else: no }] }
  bytes: { to: wire, send: BYTES, reply: { regex: '(?s)^(?P<b>....)$', framing: { type: fixed,
      size: 4 } } }
  slow: { to: wire, send: SLOW, reply: { stages: [{ equals: ACK }, { equals: DONE,
      timeout: 3s }] } }
  call: { to: call, send: CALL, reply: { regex: '^(?P<a>\\d+)$' }, idempotent: true, retries: 1 }
  tell: { to: call, send: TELL, priority: realtime }
sequences:
  dance:
    - { run: move, args: { id: 3 } }
    - { wait: 400ms }
    - { run: call }
    - { if: a > 5, then: [{ send: "{{ a }}", to: wire }, { expect: '^OK$', from: wire,
        else: [{ run: slow }] }] }
    - { set: { b: "{{ _a }}" } }
  challenge:
    - { send: NONCE, to: wire }
    - { expect: { framing: { type: fixed, size: 3 }, regex: '(?s)^(?P<_b>...)$' }, from: wire }
messages: { b: { from: wire, regex: '^B (?P<b>\\w*)$' } }
polls:
  - { run: call, every: 900ms }
  - { to: wire, send: A?, every: 300ms, when: b == 'on', offline: { after: 2, retry: 2s },
      reply: { regex: '^A=(?P<a>\\d+)$' } }
"""
)
FRAMES = (
    "HI", "> ", "PONG", "OK", "ERR", "ACK", "DONE", "END", "A", "B on", "B x", "<run>", "7",
    "1=40", "2=2", "3=9", "A=7", "A=70", "BYE", "abcd", "x" * 60,
)  # fmt: skip
COMMANDS = (*DRIVER.commands, "fly")
LINES = st.sampled_from(["wire", "call"])


class Machine(RuleBasedStateMachine):
    """Tells an engine anything, and keeps count of its answers."""

    def __init__(self) -> None:
        super().__init__()
        self.engine = Engine(DRIVER, {})
        self.now = 100.0
        self.asked = 0
        self.answered: set[int] = set()
        self.is_wanted = {"wire": True, "call": False}

    def take(self, events: list[Event]) -> None:
        for event in events:
            match event:
                case Replied(number) | Failed(number):
                    assert number not in self.answered, event
                    self.answered.add(number)
                case Open(transport):
                    self.is_wanted[transport] = True
                case Close(transport):
                    self.is_wanted[transport] = transport == "wire"

    @rule(transport=LINES, is_forced=st.integers(0, 9))
    def start(self, transport: str, is_forced: int) -> None:
        if self.is_wanted[transport] or not is_forced:
            self.is_wanted[transport] = False
            self.take(self.engine.start(transport, self.now))

    @initialize(is_ready=st.integers(0, 4))
    def begin(self, is_ready: int) -> None:
        """Most of the time, the line is ready to be talked on."""
        self.take(self.engine.tick(self.now))
        if is_ready:
            self.connect()

    @precondition(lambda self: self.is_wanted["wire"])
    @rule()
    def connect(self) -> None:
        self.is_wanted["wire"] = False
        self.take(self.engine.start("wire", self.now))
        self.take(self.engine.receive("wire", b"> ", self.now))
        self.now += 0.02
        self.take(self.engine.tick(self.now))
        self.take(self.engine.receive("wire", b"PONG\n", self.now))

    @rule(transport=LINES, reason=st.sampled_from(["", "cut"]), chance=st.integers(0, 4))
    def closed(self, transport: str, reason: str, chance: int) -> None:
        if not chance:
            self.is_wanted[transport] = transport == "wire"
            self.take(self.engine.closed(transport, reason, self.now))

    @rule(transport=LINES, data=st.binary(max_size=80))
    def receive_bytes(self, transport: str, data: bytes) -> None:
        self.take(self.engine.receive(transport, data, self.now))

    @rule(transport=LINES, frames=st.lists(st.sampled_from(FRAMES), max_size=5), ends=st.booleans())
    def receive_frames(self, transport: str, frames: list[str], ends: bool) -> None:
        data = "\n".join(frames) + "\n" * ends
        self.take(self.engine.receive(transport, data.encode(), self.now))

    @rule(command=st.sampled_from(COMMANDS), number=st.integers(0, 3), is_good=st.booleans())
    def command(self, command: str, number: int, is_good: bool) -> None:
        self.ask(command, number, is_good=is_good)

    def ask(self, command: str, number: int, *, is_good: bool) -> None:
        self.asked += 1
        found = DRIVER.commands.get(command)
        names: dict[str, Any] = dict.fromkeys(found.arguments if found else (), number)
        arguments = names if is_good else {**names, "id": "x"}
        self.take(self.engine.command(Request(self.asked, command, arguments), self.now))

    @rule(
        commands=st.lists(st.sampled_from(COMMANDS), min_size=2, max_size=9),
        number=st.integers(1, 2),
    )
    def burst(self, commands: list[str], number: int) -> None:
        for command in commands:
            self.ask(command, number, is_good=True)

    @rule(number=st.integers(1, 2), value=st.integers(0, 60))
    def answer_get(self, number: int, value: int) -> None:
        self.ask("get", number, is_good=True)
        self.take(self.engine.receive("wire", f"{number}={value}\n".encode(), self.now))

    @rule(seconds=st.floats(0, 1))
    def tick(self, seconds: float) -> None:
        self.now += seconds
        self.take(self.engine.tick(self.now))

    @rule(count=st.integers(1, 9))
    def deadlines(self, count: int) -> None:
        for _ in range(count):
            deadline = self.engine.deadline
            if deadline is not None:
                self.now = max(self.now, deadline)
                self.take(self.engine.tick(self.now))

    @precondition(lambda self: self.asked % 17 == 3)
    @rule()
    def finish(self) -> None:
        self.take(self.engine.finish(self.now))

    @invariant()
    def nothing_grows(self) -> None:
        for name, line in self.engine.lines.items():
            spec = DRIVER.transports[name]
            assert len(list(line._request_queue)) <= spec.queue.depth + 2
            assert len(line._pending_replies) <= 256
            assert line.receiver.decoder.pending <= spec.framing.max_bytes + 1
        assert len(self.engine._runners) <= 2 * len(DRIVER.transports) + len(DRIVER.commands)

    def teardown(self) -> None:
        """Whatever was asked is answered once, and the engine comes to rest."""
        for transport in DRIVER.transports:
            self.take(self.engine.closed(transport, "over", self.now))
        end = self.now + 60
        for _ in range(3000):
            deadline = self.engine.deadline
            if deadline is None or deadline > end:
                break
            assert deadline >= self.now or deadline == float("-inf")
            self.now = max(self.now, deadline)
            self.take(self.engine.tick(self.now))
        else:
            raise AssertionError("the engine wants to be called for ever")
        assert self.answered == set(range(1, self.asked + 1))


TestMachine = Machine.TestCase
TestMachine.settings = settings(max_examples=examples(60), stateful_step_count=60, deadline=None)

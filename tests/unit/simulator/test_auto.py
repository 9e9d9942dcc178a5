"""The emulated robot without rules: it answers whatever its driver declares.

Each dialogue is led by the engine that drives the real robot, against the twin of the same driver.
"""

from pathlib import Path

import pytest

from urc.config.load import load_profile
from urc.model.profile import Profile
from urc.protocol.engine import Engine
from urc.protocol.events import Event, Failed, Open, Replied, Request, Samples, Send, Violation
from urc.runtime.registries import built_in_catalog
from urc.simulator.emulated_robot import EmulatedConnection, EmulatedRobot

HEAD = """
urc: 1
kind: robot
name: robot
transports:
  wire: { type: tcp, host: 127.0.0.1, port: 6789, framing: { type: delimiter, tx: CR, rx: LF } }
"""


def profile_of(tmp_path: Path, body: str) -> Profile:
    """Return the profile of a robot of one line; a body may bring its own line."""
    head = HEAD[: HEAD.index("transports:")] if "\ntransports:" in body else HEAD
    file = tmp_path / "robot.yaml"
    file.write_text(head + body, "utf-8")
    return load_profile(file, built_in_catalog())


class Dialogue:
    """An engine and a twin, joined by nothing but bytes."""

    def __init__(self, profile: Profile, start_s: float = 0.0) -> None:
        self.now = start_s
        self.engine = Engine(profile.driver, {})
        self.emulated_robot = EmulatedRobot(profile, {})
        self.line: EmulatedConnection = self.emulated_robot.line("wire")
        self.values: dict[str, object] = {}
        self.replies: list[Event] = []
        self.faults: list[str] = []
        self.is_per_request = profile.driver.transports["wire"].connection == "per_request"
        self.perform(self.engine.tick(self.now))
        if not self.is_per_request:
            self.perform(self.engine.start("wire", self.now))

    def perform(self, events: list[Event]) -> None:
        """Carry bytes to the twin and its answers back."""
        for event in events:
            match event:
                case Send():
                    for answer in self.line.receive(event.data, self.now):
                        self.perform(self.engine.receive("wire", answer, self.now))
                case Open():
                    self.line = self.emulated_robot.line("wire")
                    self.perform(self.engine.start("wire", self.now))
                case Samples():
                    self.values.update((one.signal, one.value) for one in event.samples)
                case Replied() | Failed():
                    self.replies.append(event)
                case Violation():
                    self.faults.append(event.message)

    def wait(self, seconds: float, step_s: float = 0.05) -> None:
        """Let time pass on both sides."""
        for _ in range(round(seconds / step_s)):
            self.now += step_s
            for said in self.line.advance(step_s, self.now):
                self.perform(self.engine.receive("wire", said, self.now))
            deadline = self.engine.deadline
            if deadline is not None and deadline <= self.now:
                self.perform(self.engine.tick(self.now))

    def run(self, command: str, **arguments: object) -> Event:
        """Run a command and return its outcome."""
        request = Request(len(self.replies) + 1, command, arguments)  # type: ignore[arg-type]
        self.perform(self.engine.command(request, self.now))
        self.wait(0.2)
        return self.replies[-1]


FORMS = {
    "regex": "regex: '^V(?P<volts>[0-9]+),(?P<mode>[a-z]+)$'",
    "regex with a scale": "regex: '^V(?P<milli>[0-9]+) (?P<mode>on|off)$'",
    "pattern": 'pattern: "V {volts:number} {mode:word} {count:integer}"',
    "split": "split: { by: ',', fields: [_kind, volts, milli, mode] }\n"
    "      when: \"_kind == 'V'\"",
    "keyvalue": "keyvalue: { pairs: ';', separator: ':' }",
    "json": "json: { volts: bat.volts, cells: 'bat.cells', mode: mode, turn: turn }",
    "xml": "xml: { volts: s/@volts, mode: s/mode, milli: 's/m[2]' }",
    "equals": "equals: pong",
    "set": "split: { by: ',', fields: [_volts, mode] }\n      set: { volts: '_volts | float' }",
    "fields": "split: { by: ',', fields: [volts, code] }\n"
    "      fields: { volts: { scale: 0.01 }, code: { base: 16 } }",
    "lines": "split: { by: \"\\n\", fields: [volts, _end] }\n      lines: { until: '^END$' }",
    "three lines": "regex: '^(?P<volts>[0-9.]+)\\n(?P<mode>\\w+)\\n(?P<count>\\d+)$'\n"
    "      lines: 3",
}
SIGNALS = """
signals:
  volts: { min: 10, max: 30, precision: 1, limits: { low: 12, hihi: 29 } }
  milli: { scale: 0.001, min: 0, max: 30 }
  count: { type: integer }
  code: { type: integer, min: 0, max: 255 }
  mode: { type: string, states: { "on": running, "off": stopped } }
  cells: { type: array, size: 3, min: 3, max: 4 }
  turn: { type: array, size: 4, axes: FLU }
  power: { value: volts * 2 }
"""


@pytest.mark.parametrize("form", FORMS)
def test_poll_is_answered(form: str, tmp_path: Path) -> None:
    """By every form; what it says is in range, and no alarm begins."""
    body = f"""{SIGNALS}
polls:
  - every: 1s
    send: "ask {form.replace(" ", "_")}"
    reply:
      {FORMS[form]}
"""
    talk = Dialogue(profile_of(tmp_path, body), 1000.0)
    talk.wait(0.5)
    assert talk.faults == []
    assert talk.line.last_fault == ""
    if form != "equals":
        assert set(talk.values) & {"volts", "milli"}
        assert 10 <= talk.values.get("volts", 10) <= 30  # type: ignore[operator]
        assert talk.values.get("mode", "running") == "running"


def test_values_move_and_stay_plausible(tmp_path: Path) -> None:
    """A dashboard on the twin lives, and no limit complains."""
    body = SIGNALS + "polls: [{ every: 1s, send: v, reply: { json: { volts: v, count: c } } }]\n"
    talk = Dialogue(profile_of(tmp_path, body))
    seen = set()
    for _ in range(60):
        talk.wait(1.0, 0.5)
        seen.add(talk.values["volts"])
        assert 12 < talk.values["volts"] < 29  # type: ignore[operator]
    assert len(seen) > 20
    assert talk.values["power"] == talk.values["volts"] * 2  # type: ignore[operator]


def test_what_a_command_sets_is_remembered(tmp_path: Path) -> None:
    """Where an argument and a signal share a name, over all connections."""
    body = """
signals:
  level: { type: integer, min: 0, max: 255 }
  speed: { min: -1, max: 1, scale: 0.01 }
  mode: { type: string, states: { "1": auto, "0": manual } }
commands:
  lamp: { send: "LED {{ level }}", args: { level: { type: integer } }, reply: { equals: OK } }
  drive:
    send: "GO {{ speed | fixed(2) }} {{ mode }}"
    args: { speed: {}, mode: { type: string } }
  state:
    send: "STATE?"
    reply: { pattern: "{level:integer} {speed:integer} {mode:word}" }
"""
    talk = Dialogue(profile_of(tmp_path, body))
    assert talk.run("lamp", level=200) == Replied(1, "lamp", {})
    talk.run("drive", speed=-0.25, mode="1")
    found = talk.run("state")
    assert found == Replied(3, "state", {"level": 200, "speed": -0.25, "mode": "auto"})
    talk.line = talk.emulated_robot.line("wire")
    talk.run("drive", speed=7, mode="2")  # neither is a value of its signal
    assert talk.run("state") == found._replace(id=5)  # type: ignore[union-attr]


def test_the_frame_that_gives_exactly_this_text_is_meant(tmp_path: Path) -> None:
    """A constant goes before a template that would take it as well."""
    body = """
signals:
  a: { type: integer }
  b: { type: integer }
commands:
  any: { send: "{{ word }}", args: { word: { type: string } }, reply: { equals: any } }
  get: { send: "GET", reply: { equals: got } }
  set: { send: "SET {{ a }}", args: { a: { type: integer } }, reply: { equals: set } }
"""
    line = EmulatedRobot(profile_of(tmp_path, body), {}).line("wire")
    assert line.receive(b"GET\r", 0.0) == [b"got\n"]
    assert line.receive(b"SET 3\r", 0.0) == [b"any\n"]  # both give it; the first one declared
    assert line.receive(b"hello\r", 0.0) == [b"any\n"]


def test_an_answer_repeats_what_correlates_it(tmp_path: Path) -> None:
    """Arguments and counters of the request, by name."""
    body = """
signals:
  volts: { min: 0, max: 10 }
commands:
  ask:
    send: '{"id":{{ seq("id", 1, 99) }},"axis":{{ axis }}}'
    args: { axis: { type: integer } }
    reply: { json: { _id: id, _axis: axis, volts: v }, match: "_id == seq.id and _axis == axis" }
"""
    talk = Dialogue(profile_of(tmp_path, body))
    for number in (1, 2):
        outcome = talk.run("ask", axis=5)
        assert isinstance(outcome, Replied), outcome
        assert (outcome.values["id"], outcome.values["axis"]) == (number, 5)


def test_messages_are_sent_without_being_asked(tmp_path: Path) -> None:
    """Often enough that their signals stay fresh."""
    body = """
signals:
  volts: { min: 0, max: 10, stale_after: 600ms }
  amps: { min: 0, max: 10 }
messages:
  state: { split: { by: ",", fields: [_kind, volts] }, when: "_kind == 'V'" }
  other: { json: { amps: a } }
"""
    talk = Dialogue(profile_of(tmp_path, body))
    talk.wait(1.5)
    assert set(talk.values) == {"volts", "amps"}
    assert talk.faults == []


def test_rules_go_first_and_messages_are_then_theirs(tmp_path: Path) -> None:
    """``simulator:`` refines what the declarations give."""
    body = """
signals:
  volts: { type: integer }
messages:
  state: { regex: '^V (?P<volts>[0-9]+)$' }
commands:
  ask: { send: "ask", reply: { equals: pong } }
  other: { send: "other", reply: { equals: pong } }
simulator:
  wire:
    - { match: '^ask$', send: "V 7" }
    - { match: '^mute$' }
"""
    line = EmulatedRobot(profile_of(tmp_path, body), {}).line("wire")
    assert line.receive(b"ask\rother\rmute\r", 0.0) == [b"V 7\n", b"pong\n"]
    assert line.due_in_s is None
    assert line.faults == 0


def test_a_connection_of_one_request(tmp_path: Path) -> None:
    """Nothing is said there that was not asked for."""
    body = """
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 6789
    connection: per_request
    framing: { type: delimiter, tx: LF, rx: LF }
signals:
  volts: { min: 0, max: 10 }
messages:
  state: { regex: '^V (?P<volts>[0-9]+)$' }
polls:
  - { every: 1s, send: "volts?", reply: { regex: '^(?P<volts>[0-9.]+)$' } }
"""
    talk = Dialogue(profile_of(tmp_path, body), 5.0)
    talk.wait(1.0)
    assert set(talk.values) == {"volts"}
    assert talk.emulated_robot.line("wire").due_in_s is None


def test_what_cannot_be_answered_is_told(tmp_path: Path) -> None:
    """A search in a document has no inverse; what is said names the rule that would help."""
    body = """
signals:
  volts: { min: 0, max: 10 }
polls:
  - { every: 1s, send: "volts?", reply: { json: { volts: "max(cells)" } } }
  - { name: cells, every: 1s, send: "cells?", reply: { json: { volts: "max(cells)" } } }
commands:
  ask: { send: "ask", reply: { json: { volts: "max(cells)" } } }
"""
    line = EmulatedRobot(profile_of(tmp_path, body), {}).line("wire")
    why = "no reply can be built as json: no values to write, or conflicting paths"
    for asked, label, trigger in (
        (b"volts?", "polls.0", "match: …"),
        (b"cells?", "cells", "poll: cells"),
        (b"ask", "ask", "command: ask"),
    ):
        assert line.receive(asked + b"\r", 0.0) == []
        rule = f"write simulator: {{ wire: [{{ {trigger}, send: … }}] }}"
        assert line.last_fault == f"{label}: {why}; {rule}"


def test_the_mark_behind_the_lines_of_an_answer_takes_no_value_away(tmp_path: Path) -> None:
    """It stands in a line of its own where the last line says something."""
    body = """
signals:
  volts: { min: 0, max: 10 }
  mode: { type: string, states: { A: auto, M: manual } }
commands:
  ask:
    send: "ask"
    reply: { regex: '^(?P<volts>[0-9.]+)\\n(?P<mode>\\w+)', lines: { until: '^OK$' } }
"""
    talk = Dialogue(profile_of(tmp_path, body))
    assert isinstance(talk.run("ask"), Replied)
    assert set(talk.values) == {"volts", "mode"}
    assert talk.faults == []


def test_answers_repeat_the_counters_of_binary_requests(tmp_path: Path) -> None:
    """The request with constants is known from the one with arguments that could be the same."""
    body = """
signals:
  level: { type: integer, min: 0, max: 9 }
  any: { type: array, items: integer, size: 2 }
commands:
  read:
    args: { register: { type: integer } }
    send: { struct: [{ type: u8, value: "seq('id', 48, 99)" }, u8 register] }
    reply: { match: _id == seq.id, struct: [u8 _id, { id: any, type: u8, count: 2 }] }
polls:
  - every: 1s
    send: { struct: [{ type: u8, value: "seq('id', 48, 99)" }, u8 65] }
    reply: { match: _id == seq.id and _kind == 65, struct: [u8 _id, u8 _kind, u8 level] }
"""
    talk = Dialogue(profile_of(tmp_path, body))
    talk.wait(2.0)
    assert set(talk.values) == {"level"}


SESSION = """
signals: { volts: { type: integer } }
commands:
  get:
    send: "{{ _id }} GET {{ n }}"
    args: { n: { type: integer } }
    reply: { regex: "^= (?P<_value>[0-9]+)$" }
polls: [{ every: 1s, send: "{{ _id }} VOLTS", reply: { regex: '^V(?P<volts>\\d+)$' } }]
"""


@pytest.mark.parametrize("connection", ["persistent", "per_request"])
def test_a_session_that_the_robot_gives_comes_back_in_every_request(
    tmp_path: Path, connection: str
) -> None:
    """The emulated robot greets with some session, and knows the requests that carry it."""
    lines = HEAD.replace("rx: LF } }", "rx: LF }, connection: CONNECTION, on_connect: STEPS }")
    lines = lines.replace("CONNECTION", connection)
    lines = lines.replace("STEPS", "[{ send: HI }, { expect: '^ID (?P<_id>\\w+)$' }]")
    (tmp_path / "robot.yaml").write_text(lines + SESSION, "utf-8")
    talk = Dialogue(load_profile(tmp_path / "robot.yaml", built_in_catalog()))
    talk.run("get", n=3)
    talk.wait(1.5)
    assert [type(one) for one in talk.replies] == [Replied]
    assert "volts" in talk.values
    assert talk.faults == []


def test_a_header_of_a_type_is_read_and_written(tmp_path: Path) -> None:
    """Modbus on TCP: the transaction number of a request, and the unit, come back."""
    profile = profile_of(
        tmp_path,
        """
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 502
    framing: { type: length, length: { offset: 4, size: 2, adjust: 6 }, payload: { from: 0 } }
settings: { unit: { type: integer, default: 17 } }
signals: { level: { type: integer, min: 3, max: 4 } }
types:
  header:
    - { id: _id, type: u16be, value: "seq('id', 1, 65535)" }
    - u16be 0
    - { type: u16be, value: "_size - 6" }
    - { type: u8, value: settings.unit }
commands:
  read:
    send: { struct: [header, u8 3, u16be 1, u16be 1] }
    reply: { struct: [header, u8 3, u8 2, u16be level], match: _id == seq.id }
  write:
    args: { level: { type: integer, min: 0, max: 9 } }
    send: { struct: [{ id: head, type: header }, u8 6, u16be 1, u16be level] }
    reply: { struct: [header, u8 6, u16be 1, u16be _level], match: _id == seq.id }
""",
    )
    line = EmulatedRobot(profile, {"unit": 17}).line("wire")
    ask = bytes.fromhex("0005 0000 0006 11 03 0001 0001")
    assert line.receive(ask, 0.0)[0][:-1] == bytes.fromhex("0005 0000 0005 11 03 02 00")
    write = bytes.fromhex("0006 0000 0006 11 06 0001 0004")
    assert line.receive(write, 0.0)[0][:9] == bytes.fromhex("0006 0000 0006 11 06 00")

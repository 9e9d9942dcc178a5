"""Rules of the emulated robot that wait, change its values, and speak in any form."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effort import examples
from urc.config.load import check
from urc.model.payload import Envelope
from urc.problems import to_text
from urc.runtime.document_tests import sample_settings
from urc.runtime.registries import built_in_catalog
from urc.simulator.emulated_robot import MOST_COURSES, EmulatedConnection, EmulatedRobot

DRIVER = r"""
urc: 1
kind: robot
name: cart
transports:
  wire:
    { type: tcp, host: 127.0.0.1, port: 1, framing: { type: delimiter, tx: LF, rx: LF } }
  pad: { type: tcp, host: 127.0.0.1, port: 2, framing: { type: fixed, size: 2 } }
signals:
  battery: { type: integer, min: 0, max: 100 }
  mode: { type: string, states: { I: idle, D: driving } }
  speed: { min: -1, max: 1 }
  half: { value: battery / 2 }
messages:
  mode: { from: wire, regex: '^MODE (?P<mode>\w)$' }
  speed: { from: wire, regex: '^V (?P<speed>[-0-9.]+)$' }
commands:
  drive: { to: wire, send: "DRIVE {{ speed }}", args: { speed: {} }, reply: { equals: OK } }
  load:
    to: wire
    send: LOAD
    reply:
      split: { by: ",", fields: [battery] }
      framing: { type: delimiter, tx: ";", rx: ";" }
polls:
  - { name: battery, to: wire, every: 1s, send: "B?", reply: { regex: '^B (?P<battery>\d+)$' } }
simulator:
"""
MORE = {
    "command: raw": """  raw: { to: wire, send: "{{ text }}", args: { text: { type: string } } }
""",
    "poll: battery, send": """  same: { to: wire, send: "B?", reply: { equals: no } }\n""",
}
"""Rule → command that would take the frames of other dialogues."""


def emulated_robot(tmp_path: Path, rules: str) -> EmulatedRobot:
    """Return the emulated robot with `rules` under ``simulator:``."""
    file = tmp_path / "cart.yaml"
    text = DRIVER
    for name, command in MORE.items():
        if name in rules:
            text = text.replace("polls:\n", f"{command}polls:\n")
    file.write_text(text + rules)
    checked = check(file, built_in_catalog())
    assert [to_text(one) for one in checked.problems if one.severity == "error"] == []
    assert checked.profile is not None
    return EmulatedRobot(checked.profile, sample_settings(checked.profile.settings))


def talk(line: EmulatedConnection, dialogue: list[tuple[object, list[bytes]]]) -> None:
    """Say bytes, or let seconds pass, and compare what the robot says."""
    now_s = 0.0
    for what, expected in dialogue:
        if isinstance(what, bytes):
            said = line.receive(what, now_s)
        else:
            assert isinstance(what, float)
            now_s += what
            said = line.advance(what, now_s)
        assert (what, said) == (what, expected)


DIALOGUES: dict[str, tuple[str, list[tuple[object, list[bytes]]]]] = {
    "first values are told by declared answers": (
        "  signals: { battery: 80, speed: 0.25, mode: driving }\n",
        [(b"B?\n", [b"B 80\n"]), (9.0, [b"MODE D\n", b"V 0.25\n"])],
    ),
    "a command sets more than its arguments, and messages tell it": (
        """
  signals: { battery: 80, mode: idle }
  wire: [{ command: drive, set: { mode: driving, battery: "{{ battery - 10 * speed }}" } }]
""",
        [(b"DRIVE 0.5\n", [b"OK\n"]), (b"B?\n", [b"B 75\n"]), (1.0, [b"MODE D\n", b"V 0.5\n"])],
    ),
    "acknowledged now, done later, with what the request said": (
        """
  wire:
    - command: drive
      send: ACK
      set: { mode: driving }
      then: [{ after: 2s, send: "DONE {{ speed }}", set: { mode: idle } }]
""",
        [
            (b"DRIVE -1\n", [b"ACK\n"]),
            (0.9, []),
            (0.1, [b"MODE D\n", b"V -1\n"]),
            (0.9, []),
            (0.1, [b"DONE -1\n", b"MODE I\n", b"V -1\n"]),
        ],
    ),
    "declared answers come later, too": (
        "  signals: { battery: 3 }\n  wire: [{ poll: battery, after: 500ms }]\n",
        [(b"B?\n", []), (0.5, [b"B 3\n"])],
    ),
    "a rule whose condition does not hold is passed over": (
        """
  state: { tries: 0 }
  wire:
    - { match: '^GO$', when: tries >= 2, send: "GONE {{ tries }}" }
    - { match: '^GO$', set: { tries: "{{ tries + 1 }}" }, send: WAIT }
""",
        [(b"GO\nGO\nGO\n", [b"WAIT\n", b"WAIT\n", b"GONE 2\n"])],
    ),
    "a poll and a command that send the same": (
        "  wire: [{ poll: battery, send: P }]\n",
        [(b"B?\n", [b"P\n"])],
    ),
    "a command whose text could be anything takes what no other one sends": (
        "  wire: [{ command: raw, send: 'R {{ text }}' }]\n",
        [(b"DRIVE 1\n", [b"OK\n"]), (b"hello\n", [b"R hello\n"])],
    ),
    "an answer with the framing of its reply, and one with its own": (
        """
  signals: { battery: 5 }
  wire:
    - { command: load, send: "7" }
    - { match: '^X$', send: { hex: "01 {{ battery | u8 }}" }, framing: { type: datagram } }
""",
        [(b"LOAD\n", [b"7;"]), (b"X\n", [b"\x01\x05"])],
    ),
    "binary frames, read and written by a struct": (
        """
  state: { total: 0 }
  pad:
    - match: { struct: [u8 7, i8 step] }
      set: { total: "{{ total + step }}" }
      send: { struct: [u8 8, { type: i8, value: total }] }
""",
        [(b"\x07\x03\x07\xff", [b"\x08\x03", b"\x08\x02"]), (b"\x09\x00", [])],
    ),
    "forms of text, with conversions": (
        """
  wire:
    - match: { split: { by: ":", fields: [a, b] }, fields: { b: { scale: 2 } }, when: a == 'x' }
      send: "{{ b }}"
    - { match: { json: { n: deep.n } }, send: { json: { n: "{{ n + 1 }}" } } }
""",
        [(b'x:4\n{"deep":{"n":1}}\n', [b"8\n", b'{"n":2}\n'])],
    ),
    "numbers stop at the ends of their range": (
        """
  signals: { battery: 1, speed: 0 }
  wire: [{ every: 1s, set: { battery: "{{ battery - 0.6 }}" } }]
""",
        [(1.0, [b"MODE I\n", b"V 0\n"]), (b"B?\n", [b"B 0\n"])],
    ),
    "computed signals follow those they are computed from": (
        "  signals: { battery: 30 }\n  wire: [{ match: '^H$', send: '{{ half }}' }]\n",
        [(b"H\n", [b"15\n"])],
    ),
    "counters count what is sent": (
        "  wire: [{ match: '^N$', send: \"{{ seq('n', 1, 2) }}\" }]\n",
        [(b"N\nN\nN\n", [b"1\n", b"2\n", b"1\n"])],
    ),
    "what is set is computed from what was before": (
        """
  state: { a: 1, b: 2 }
  wire:
    - match: '^S$'
      set: { a: "{{ b }}", b: "{{ a }}" }
      send: "?"
      then: [{ send: "{{ a }}{{ b }}" }]
""",
        [(b"S\n", [b"?\n", b"21\n"])],
    ),
    "a reaction waits for its condition": (
        """
  state: { ready: false }
  wire:
    - match: '^GO$'
      send: "?"
      then: [{ until: ready, send: "!" }]
    - { match: '^R$', set: { ready: true } }
""",
        [(b"GO\n", [b"?\n"]), (1.0, []), (b"R\n", []), (0.2, [b"!\n"])],
    ),
    "a condition that fails is not true yet": (
        """
  state: { count: 0 }
  wire:
    - match: '^GO$'
      send: "?"
      then: [{ until: 1 / count > 0, send: "!" }]
    - { match: '^R$', set: { count: 1 } }
""",
        [(b"GO\n", [b"?\n"]), (1.0, []), (b"R\n", []), (0.2, [b"!\n"])],
    ),
    "a rule takes a frame and says nothing": (
        "  wire: [{ command: drive, answer: none }, { match: '^B', answer: auto }]\n",
        [(b"DRIVE 1\n", [])],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", DIALOGUES)
def test_rules_do_what_they_say(name: str, tmp_path: Path) -> None:
    """Spoken to, and as time goes by."""
    rules, dialogue = DIALOGUES[name]
    line = emulated_robot(tmp_path, rules.lstrip("\n")).line("pad" if "  pad:" in rules else "wire")
    talk(line, dialogue)


FAULTS = [
    ("{ match: '^X$', set: { speed: '{{ word }}' } }", "speed: 'fast' is not a number"),
    ("{ match: '^X$', set: { mode: '{{ word }}' } }", "mode: 'fast' is not one of the states idle"),
    ("{ match: '^X$', when: 1 / 0 > 1, send: y }", "in '1 / 0 > 1': division by zero"),
    ("{ match: '^X$', send: { hex: '{{ 300 | u8 }}' } }", "300"),
    (
        "{ match: { regex: '^(?P<n>.)$', fields: { n: { scale: 2 } } }, send: '{{ n }}' }",
        "n: 'X' is not a number",
    ),
    ("{ match: '^X$', answer: auto }", "the driver never sends this frame and declares no reply"),
    ("{ match: '^X$', send: \"a\\nb\" }", "contains the delimiter"),
    ("{ match: '^X$', answer: refused }", "only a call or a goal of ROS can be refused"),
]  # fmt: skip


@pytest.mark.parametrize(("rule", "fault"), FAULTS)
def test_what_a_rule_cannot_do_is_counted_and_told(rule: str, fault: str, tmp_path: Path) -> None:
    """One fault, one line, and the robot goes on."""
    rules = f"  state: {{ word: fast }}\n  wire: [{rule}]\n"
    line = emulated_robot(tmp_path, rules).line("wire")
    assert line.receive(b"X\n", 0.0) == []
    assert line.faults == 1
    assert fault in line.last_fault
    assert line.receive(b"B?\n", 0.0) != []


def test_a_closing_rule_ends_the_connection(tmp_path: Path) -> None:
    """What comes after it is not looked at, and nothing more is said."""
    rules = "  wire: [{ match: '^QUIT$', send: BYE, close: true, then: [{ send: no }] }]\n"
    line = emulated_robot(tmp_path, rules).line("wire")
    assert not line.is_over
    assert line.receive(b"QUIT\nB?\n", 0.0) == [b"BYE\n"]
    assert line.is_over
    assert line.receive(b"B?\n", 0.0) == []
    assert line.advance(9.0, 9.0) == []


def test_time_changes_the_robot_once_however_many_look(tmp_path: Path) -> None:
    """Each connection has its own messages; the battery is one, until nobody is there."""
    rule = "{ every: 1s, set: { battery: '{{ battery - 1 }}' } }"
    rules = f"  signals: {{ battery: 50 }}\n  wire: [{rule}]\n"
    robot = emulated_robot(tmp_path, rules)
    first, second = robot.line("wire"), robot.line("wire")
    for now_s in (1.0, 2.0):
        for line in (first, second):
            assert len(line.advance(1.0, now_s)) == 2
    assert second.receive(b"B?\n", 2.0) == [b"B 48\n"]
    del first, line
    second.advance(1.0, 3.0)
    assert second.receive(b"B?\n", 3.0) == [b"B 47\n"]


def test_answers_that_wait_are_bounded(tmp_path: Path) -> None:
    """A client that asks for more than that is told, and the oldest stay."""
    line = emulated_robot(tmp_path, "  wire: [{ match: '^W$', after: 1s, send: w }]\n").line("wire")
    line.receive(b"W\n" * (MOST_COURSES + 3), 0.0)
    assert line.faults == 3
    assert "delayed replies are already queued" in line.last_fault
    assert line.due_in_s == 1.0
    assert line.advance(1.0, 1.0) == [b"w\n"] * MOST_COURSES


ALL_FORMS = """
  state: { total: 0 }
  wire:
    - { match: { split: { by: ":", fields: [a, b] }, fields: { b: { scale: 2 } }, when: a > 1 }, send: "{{ b }}" }
    - { match: { keyvalue: { pairs: ";", separator: "=", fields: { a: a } } }, send: "{{ a }}" }
    - { match: { json: { a: a } }, send: { json: { a: "{{ a }}" } }, then: [{ after: 1s, send: "{{ a }}" }] }
    - { match: { xml: { a: a } }, set: { battery: "{{ a }}" }, answer: auto }
    - { match: { pattern: "is {a:integer}" }, when: a / total > 1, set: { total: "{{ a }}" } }
    - { command: drive, set: { battery: "{{ speed }}" } }
    - { match: '^(?P<a>.+)!$', set: { mode: "{{ a }}" }, message: mode }
    - { every: 100ms, when: total > 1, set: { total: "{{ total - 1 }}" }, message: mode }
  pad: [{ match: { struct: [u8 kind, i8 step] }, set: { total: "{{ total / step }}" }, send: { hex: "{{ total | u8 }} 00" } }]
"""  # noqa: E501
FRAMES = st.sampled_from(
    [
        "a:b",
        "2:3",
        "a=1;b=2",
        '{"a":[1]}',
        '{"a":',
        "<a>7</a>",
        "is 5",
        "is 0",
        "DRIVE 9e999",
        "D!",
        "B?",
    ]
)


@pytest.fixture(scope="module")
def robot_of_all_forms(tmp_path_factory: pytest.TempPathFactory) -> EmulatedRobot:
    return emulated_robot(tmp_path_factory.mktemp("rules"), ALL_FORMS.lstrip("\n"))


@given(
    st.lists(st.binary(max_size=12) | FRAMES.map(lambda text: text.encode() + b"\n"), max_size=12)
)
@settings(max_examples=examples(300), deadline=None)
def test_nothing_that_a_client_says_breaks_the_robot(
    robot_of_all_forms: EmulatedRobot, pieces: list[bytes]
) -> None:
    """On any line, by any rule, at any time: it answers, or counts a fault."""
    for name in ("wire", "pad"):
        line = robot_of_all_forms.line(name)
        for now_s, piece in enumerate(pieces):
            said = [*line.receive(piece, float(now_s)), *line.advance(0.5, float(now_s))]
            assert all(isinstance(one, bytes) for one in said)


def test_messages_are_taken_and_answered_by_rules(tmp_path: Path) -> None:
    """A request by the command that sends it, a topic by the form of its messages."""
    file = tmp_path / "rover.yaml"
    file.write_text(ROVER)
    checked = check(file, built_in_catalog())
    assert [to_text(one) for one in checked.problems if one.severity == "error"] == []
    assert checked.profile is not None
    robot = EmulatedRobot(checked.profile, {})
    web, ros = robot.line("web"), robot.line("ros")
    put = Envelope("request", {"method": "PUT", "path": "/level/9", "id": 3})
    assert web.receive(put, 0.0) == [
        Envelope("response", {"id": 3, "ok": True, "status": 200}, b"done 9")
    ]
    drive = Envelope("publish", {"topic": "/cmd_vel", "type": "t"}, {"linear": {"x": 0.25}})
    assert ros.receive(drive, 0.0) == []
    assert (web.faults, ros.faults) == (0, 0)
    assert ros.advance(1.0, 1.0) == [Envelope("message", {"topic": "/x"}, b'{"data":0.5}')]
    assert ros.receive(Envelope("publish", {"topic": "/other"}, {}), 0.0) == []
    assert ros.last_fault.startswith("no rule matches 'publish topic=/other")


ROVER = """
urc: 1
kind: robot
name: rover
transports:
  ros: { type: ros, host: robot }
  web: { type: http, url: "http://robot" }
signals: { x: { min: 0, max: 1 } }
messages:
  x: { from: ros, subscribe: { topic: /x, type: std_msgs/Float32 }, json: { x: data } }
commands:
  put:
    to: web
    args: { n: { type: integer } }
    send: { request: { method: PUT, path: "/level/{{ n }}" } }
    reply: { regex: '^done' }
simulator:
  web: [{ command: put, send: "done {{ n }}" }]
  ros:
    - match: { json: { speed: linear.x }, subscribe: { topic: /cmd_vel } }
      set: { x: "{{ speed * 2 }}" }
"""

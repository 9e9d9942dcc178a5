"""What the dev page answers: the parser on pasted bytes, and what a command would send."""

from pathlib import Path

import pytest

from urc.config.load import load_profile
from urc.model.driver import Driver
from urc.model.payload import Envelope
from urc.problems import UrcError
from urc.runtime.registries import built_in_catalog
from urc.web.dev.preview import preview
from urc.web.dev.tryout import MOST_PIECES, FrameConsumer, pasted_bytes, try_out

WIRE = """
urc: 1
kind: driver
name: talker
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 6789
    framing: FRAMING
"""

LINES = "{ type: delimiter, tx: LF, rx: LF }"

ROBOT = """
signals:
  battery: { type: number, unit: "%", min: 0, max: 100, limits: { low: 20 } }
  state: { type: string }
messages:
  level: { from: wire, regex: '^BAT (?P<battery>[0-9]+)$' }
  mood: { from: wire, regex: '^S (?P<state>\\w+) (?P<_n>\\d)$', when: "_n == '1'" }
commands:
  arm: { send: "ARM", reply: { regex: '^OK$', errors: ['^ERR'] } }
  stop:
    send: "STOP"
    reply: { regex: '^OK$', errors: ['^ERR'] }
    confirm: { text: Really stop? }
  go:
    args: { speed: { type: number, min: 0, max: 2 }, name: { type: string, default: x } }
    send: "GO {{ speed }} {{ name }}"
sequences:
  both:
    steps:
      - { run: arm }
      - { wait: 1s }
      - { to: wire, send: "NOW" }
"""

LAMP = """
urc: 1
kind: driver
name: lamp
transports:
  broker: { type: mqtt, host: 127.0.0.1 }
signals:
  lit: { type: boolean }
messages:
  state: { subscribe: { topic: lamp/state }, json: { lit: on } }
commands:
  switch:
    args: { lit: { type: boolean } }
    send: { publish: { topic: lamp/set, qos: 1, json: { on: "{{ lit }}" } } }
"""


def loaded(folder: Path, text: str) -> Driver:
    """Return the driver in a document."""
    file = folder / "talker.yaml"
    file.write_text(text, "utf-8")
    return load_profile(file, built_in_catalog()).driver


@pytest.fixture
def robot(tmp_path: Path) -> Driver:
    """Return a driver on a line of text."""
    return loaded(tmp_path, WIRE.replace("FRAMING", LINES) + ROBOT)


@pytest.fixture
def lamp(tmp_path: Path) -> Driver:
    """Return a driver on a line of messages."""
    return loaded(tmp_path, LAMP)


def test_bytes_are_pasted_as_hex_or_as_text() -> None:
    """Blanks say nothing in hex; escapes are bytes in text; what is neither is told of."""
    assert pasted_bytes("0x42 41,54:0a", is_hex=True, encoding="utf-8") == b"BAT\n"
    assert pasted_bytes(r"BAT\r\n\x00\\", is_hex=False, encoding="utf-8") == b"BAT\r\n\0\\"
    with pytest.raises(UrcError, match="group 2 is '4'"):
        pasted_bytes("42 4", is_hex=True, encoding="utf-8")
    with pytest.raises(UrcError, match=r"character 2: .* found \\q"):
        pasted_bytes(r"a\q", is_hex=False, encoding="utf-8")
    with pytest.raises(UrcError, match="cannot be encoded as ascii"):
        pasted_bytes("ü", is_hex=False, encoding="ascii")
    with pytest.raises(UrcError, match="at most 65536 are parsed"):
        pasted_bytes("x" * 70_000, is_hex=False, encoding="utf-8")


def test_frames_are_shown_with_their_takers(robot: Driver) -> None:
    """Where each was cut, what took it, which fields and signals, with the alarm."""
    found = try_out(robot, {}, "wire", b"BAT 12\nOK\nBAT 9")
    assert [(piece.start, piece.end, piece.data) for piece in found.pieces] == [
        (0, 7, b"BAT 12"),
        (7, 10, b"OK"),
    ]
    assert found.left == 5
    assert found.pieces[0].takers == (
        FrameConsumer(
            "message", ("message level",), {"battery": "12"}, (("battery", 12.0, "low"),), ()
        ),
    )
    (reply,) = found.pieces[1].takers
    assert (reply.kind, reply.names) == ("reply", ("reply to arm", "reply to stop"))


def test_a_value_that_is_none_is_told(robot: Driver) -> None:
    """The frame is taken, and its value refused."""
    (piece,) = try_out(robot, {}, "wire", b"BAT 101\n").pieces
    assert piece.takers[0].samples == ()
    assert "battery" in piece.takers[0].refused[0]


def test_a_refusal_is_no_answer(robot: Driver) -> None:
    """What the robot says when it fails is told as that."""
    (piece,) = try_out(robot, {}, "wire", b"ERR 7\n").pieces
    assert piece.takers[0].kind == "refusal"
    assert "ERR 7" in piece.takers[0].refused[0]


def test_nobody_takes_it_and_each_says_why(robot: Driver) -> None:
    """A pattern that does not match, and a condition that does not hold."""
    (piece,) = try_out(robot, {}, "wire", b"S idle 2\n").pieces
    assert piece.takers == ()
    assert "message level: the pattern ^BAT (?P<battery>[0-9]+)$ does not match" in piece.reasons
    assert "message mood: the condition under 'when' is false: _n == '1'" in piece.reasons
    (piece,) = try_out(robot, {}, "wire", b"\xff\n").pieces
    assert all("is not utf-8 text" in reason for reason in piece.reasons)


def test_bytes_that_are_no_frame_are_shown_with_the_fault(tmp_path: Path) -> None:
    """A checksum that is wrong is told, and where its bytes are."""
    framing = LINES.replace(" }", ", checksum: { algorithm: xor8 } }")
    text = WIRE.replace("FRAMING", framing) + "messages: { any: { regex: '^x$' } }"
    driver = loaded(tmp_path, text)
    (piece,) = try_out(driver, {}, "wire", b"x\x00\n").pieces
    assert (piece.start, piece.end) == (0, 3)
    assert piece.fault.startswith("bad-checksum: ")
    (good,) = try_out(driver, {}, "wire", b"xx\n").pieces
    assert [taker.names for taker in good.takers] == [("message any",)]


def test_a_flood_of_frames_is_cut(robot: Driver) -> None:
    """A few hundred are shown, the rest is counted."""
    found = try_out(robot, {}, "wire", b"BAT 1\n" * (MOST_PIECES + 7))
    assert (len(found.pieces), found.more) == (MOST_PIECES, 7)


def test_a_message_is_tried_with_its_topic(lamp: Driver) -> None:
    """Taken on its own topic; on another one it is said which it listens to."""
    (piece,) = try_out(lamp, {}, "broker", b'{"on": true}', "lamp/state").pieces
    assert piece.takers[0].samples == (("lit", True, ""),)
    (piece,) = try_out(lamp, {}, "broker", b'{"on": true}', "lamp/other").pieces
    assert piece.reasons == ("message state: expected the topic 'lamp/state', found 'lamp/other'",)


def test_an_unknown_line_is_refused(robot: Driver) -> None:
    """There is one of another name."""
    with pytest.raises(UrcError, match="no transport 'radio'; known transports: wire"):
        try_out(robot, {}, "radio", b"")


def test_a_preview_is_what_would_be_sent(robot: Driver) -> None:
    """To the byte, with defaults filled in and the framing around it."""
    (frame,) = preview(robot, {}, "go", {"speed": 1.5}).frames
    assert (frame.transport, frame.payload) == ("wire", b"GO 1.5 x\n")


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({}, "go needs the argument 'speed'"),
        ({"speed": 3}, "speed: 3 is above its maximum 2"),
        ({"speed": "fast"}, "speed: expected number, found 'fast'"),
        ({"speed": 1, "name": "a\nb"}, "control characters"),
        ({"speed": 1, "colour": "red"}, "go has no argument 'colour'"),
    ],
)
def test_a_refusal_is_shown_in_words(robot: Driver, given: dict[str, object], told: str) -> None:
    """The same words as the robot's own page would get."""
    shown = preview(robot, {}, "go", given)
    assert shown.frames == ()
    assert told in shown.refusal


def test_what_is_asked_before_is_shown(robot: Driver) -> None:
    """A question belongs to the command, also here."""
    assert preview(robot, {}, "stop", {}).questions == ("Really stop?",)
    assert "there is no command 'hop'" in preview(robot, {}, "hop", {}).refusal


def test_a_sequence_is_shown_step_by_step(robot: Driver) -> None:
    """Frames where they are known beforehand, words where something is waited for."""
    frames = preview(robot, {}, "both", {}).frames
    assert [frame.text or frame.payload for frame in frames] == [
        "runs arm",
        b"ARM\n",
        "waits 1 s",
        b"NOW\n",
    ]


def test_a_message_is_shown_with_its_address(lamp: Driver) -> None:
    """Verb, topic and body."""
    (frame,) = preview(lamp, {}, "switch", {"lit": True}).frames
    assert isinstance(frame.payload, Envelope)
    assert (frame.payload.verb, frame.payload.attributes["topic"]) == ("publish", "lamp/set")

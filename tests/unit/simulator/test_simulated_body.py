"""An emulated robot with a body, between its line and its world; and rules by their names."""

from pathlib import Path

import pytest

from urc.config.load import check, load_profile
from urc.model.payload import Envelope
from urc.model.profile import Profile
from urc.problems import to_text
from urc.runtime.registries import built_in_catalog
from urc.simulator.emulated_robot import EmulatedRobot

CART = r"""
urc: 1
kind: robot
name: cart
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 1
    framing: { type: delimiter, tx: LF, rx: LF }
    on_close: [{ send: D 0 }]
  web: { type: http, url: "http://robot" }
signals:
  x: { unit: m }
  speed: { unit: m/s }
  eye: { type: image }
  turned: { type: boolean }
messages:
  at: { from: wire, regex: '^X (?P<x>[-0-9.]+) (?P<speed>[-0-9.]+)$' }
  eye: { from: web, subscribe: { topic: /eye.jpg, stream: stills }, raw: eye }
commands:
  drive:
    to: wire
    args: { speed: { min: -1, max: 1, default: 0 } }
    send: "D {{ speed }}"
    hold: { repeat: 100ms, release: { speed: 0 }, watchdog: 500ms }
simulator:
  signals: { turned: false }
  state: { v: 0.0 }
  world:
    body: { type: differential, acceleration: 100 }
    drive: { forward: "{{ v }}" }
    camera: { width: 64, height: 48, flip: "{{ turned }}" }
    map: { ground: grass }
    signals: { x: "{{ world.x }}", speed: "{{ world.speed }}", eye: "{{ world.picture }}" }
  wire:
    - { command: drive, set: { v: "{{ speed }}" } }
    - { match: '^TURN$', set: { turned: true } }
    - { every: 100ms, message: at }
"""


def profile_of(folder: Path, text: str, name: str = "robot.yaml") -> Profile:
    """Return the profile in a document that is without an error."""
    file = folder / name
    file.write_text(text)
    checked = check(file, built_in_catalog())
    assert [to_text(one) for one in checked.problems if one.severity == "error"] == []
    assert checked.profile is not None
    return checked.profile


def test_a_command_moves_the_body_and_the_signals_follow(tmp_path: Path) -> None:
    """An argument that is called like a signal of the world does not change that signal."""
    line = EmulatedRobot(profile_of(tmp_path, CART), {}).line("wire")
    assert line.receive(b"D 0.5\n", 0.0) == []
    assert line.advance(0.1, 0.2) == [b"X 0.1 0.5\n"]
    assert line.receive(b"D 0\n", 0.2) == []
    assert line.advance(0.1, 0.4) == [b"X 0.1 0\n"]


def test_a_release_that_is_also_the_good_bye_stops_it(tmp_path: Path) -> None:
    """The rule of the command takes the frame, though the script sends the same bytes."""
    robot = EmulatedRobot(profile_of(tmp_path, CART), {})
    line = robot.line("wire")
    line.receive(b"D 1\n", 0.0)
    line.receive(b"D 0\n", 0.1)
    assert robot.body is not None
    robot.body.world.advance(0.3)
    assert robot.body.world.motion.forward == 0.0
    assert line.faults == 0


def test_a_command_with_an_answer_keeps_its_frames_to_itself(tmp_path: Path) -> None:
    """Another one whose text could be anything does not take them."""
    text = CART.replace(
        "simulator:\n",
        "  hello: { to: wire, send: D hello, reply: { equals: hi } }\nsimulator:\n",
    ).replace("D {{ speed }}", "D {{ speed | string }}")
    text = text.replace("{ min: -1, max: 1, default: 0 }", "{ type: string, default: '0' }")
    text = text.replace("release: { speed: 0 }", "release: { speed: '0' }")
    line = EmulatedRobot(profile_of(tmp_path, text), {}).line("wire")
    assert line.receive(b"D hello\n", 0.0) == [b"hi\n"]


def test_its_watchdog_stops_it_though_nobody_is_connected(tmp_path: Path) -> None:
    """Half a second after the last command, to the step; the line is gone by then."""
    robot = EmulatedRobot(profile_of(tmp_path, CART), {})
    robot.line("wire").receive(b"D 1\n", 0.0)
    body = robot.body
    assert body is not None
    body.world.advance(0.4)
    assert body.world.motion.forward == 1.0
    body.world.advance(5.0)
    assert body.world.motion.x == pytest.approx(0.5, abs=0.12)
    assert body.world.motion.forward == 0.0


def test_a_robot_without_a_watchdog_goes_on(tmp_path: Path) -> None:
    """As the real one does."""
    robot = EmulatedRobot(profile_of(tmp_path, CART.replace("500ms", "none")), {})
    robot.line("wire").receive(b"D 1\n", 0.0)
    assert robot.body is not None
    robot.body.world.advance(5.0)
    assert robot.body.world.motion.x == pytest.approx(5.0, abs=0.1)


def test_a_failsafe_changes_the_state_once(tmp_path: Path) -> None:
    """And a command after it is obeyed again."""
    failsafe = "    failsafe: { after: 1s, without: [drive], set: { v: 0.25 } }\n"
    text = CART.replace("    camera:", f"{failsafe}    camera:")
    robot = EmulatedRobot(profile_of(tmp_path, text), {})
    line = robot.line("wire")
    line.receive(b"D 1\n", 0.0)
    assert robot.body is not None
    robot.body.world.advance(3.0)
    assert robot.body.world.motion.forward == 0.25
    line.receive(b"D 1\n", 3.0)
    robot.body.world.advance(3.5)
    assert robot.body.world.motion.forward == 1.0


def test_a_picture_of_the_world_is_what_the_web_server_gives(tmp_path: Path) -> None:
    """By the topic that the driver listens to, drawn as the document's templates say."""
    robot = EmulatedRobot(profile_of(tmp_path, CART), {})
    upright = robot.picture("web", ("/eye.jpg",), 0.0)
    assert upright is not None
    assert upright[:2] == b"\xff\xd8"
    assert robot.camera(0.0) == upright
    assert robot.picture("web", ("/other.jpg",), 0.0) is None
    assert robot.picture("wire", ("/eye.jpg",), 0.0) is None
    robot.line("wire").receive(b"TURN\n", 1.0)
    assert robot.picture("web", ("/eye.jpg",), 1.0) != upright
    robot.inject("dropout=eye", 1.0)
    assert robot.picture("web", ("/eye.jpg",), 1.0) == b""


def test_an_input_that_is_no_number_moves_nothing_and_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Once, not fifty times a second."""
    text = CART.replace('forward: "{{ v }}"', "forward: \"{{ 'fast' if v else 0 }}\"")
    robot = EmulatedRobot(profile_of(tmp_path, text), {})
    with caplog.at_level("INFO", "urc.simulator.emulated_robot"):
        robot.line("wire").receive(b"D 1\n", 0.0)
        assert robot.body is not None
        robot.body.world.advance(0.4)
    assert robot.body.world.motion.x == 0.0
    told = [one.getMessage() for one in caplog.records]
    assert told == ["world.drive.forward: expected a number, found 'fast'"]


def test_a_rule_publishes_to_who_listens(tmp_path: Path) -> None:
    """What a robot publishes is a message to its clients."""
    text = """
urc: 1
kind: robot
name: ros
transports: { ros: { type: ros, host: robot } }
signals: { x: {} }
messages: { x: { subscribe: { topic: /x, type: std_msgs/Float32 }, json: { x: data } } }
simulator:
  ros:
    - every: 1s
      send: { publish: { topic: /x, type: std_msgs/Float32, json: { data: 0.5 } } }
"""
    line = EmulatedRobot(profile_of(tmp_path, text), {}).line("ros")
    said = line.advance(1.0, 1.0)
    assert [(one.verb, one.attributes) for one in said if isinstance(one, Envelope)] == [
        ("message", {"topic": "/x"})
    ]


def test_rules_of_a_transport_that_is_called_like_a_key(tmp_path: Path) -> None:
    """Under `rules`, beside the values of that key."""
    text = CART.replace("  web:", "  state:", 1).replace("from: web", "from: state")
    text = text.replace(
        "simulator:\n", "simulator:\n  rules:\n    state: [{ match: '^x$', send: y }]\n"
    )
    profile = profile_of(tmp_path, text)
    assert {rule.transport for rule in profile.simulator} == {"wire", "state"}
    assert profile.emulated["v"] == 0.0


BASE = """
urc: 1
kind: driver
name: base
transports:
  wire: { type: tcp, host: robot, port: 1, framing: { type: delimiter, tx: LF, rx: LF } }
signals: { x: {} }
messages: { at: { regex: '^X (?P<x>[0-9]+)$' } }
simulator:
  signals: { x: 1 }
  wire:
    - { name: hello, match: '^HELLO$', send: hi }
    - { name: bye, match: '^BYE$', close: true }
    - { match: '^.*$', send: what }
"""
OVER = """
  wire:
    - { name: hello, send: "{{ x }}" }
    - { name: bye, remove: true }
    - { name: ping, match: '^PING$', send: pong }
"""
ANSWERS = {b"HELLO\n": b"7\n", b"BYE\n": b"what\n", b"PING\n": b"pong\n", b"?\n": b"what\n"}


@pytest.mark.parametrize("way", ["extends", "overrides"])
def test_rules_are_changed_by_their_names(tmp_path: Path, way: str) -> None:
    """One is changed, one taken away, a new one goes first; those without a name stay."""
    (tmp_path / "base.yaml").write_text(BASE)
    over = f"simulator:\n  signals: {{ x: 7 }}{OVER}"
    if way == "extends":
        text = f"urc: 1\nkind: driver\nname: robot\nextends: base.yaml\n{over}"
    else:
        inner = "".join(f"    {line}\n" for line in over.splitlines())
        text = f"urc: 1\nkind: robot\nname: robot\ndriver:\n  use: base.yaml\n  overrides:\n{inner}"
    line = EmulatedRobot(profile_of(tmp_path, text), {}).line("wire")
    assert {asked: line.receive(asked, 0.0)[0] for asked in ANSWERS} == ANSWERS


def test_a_robot_changes_the_simulator_of_its_driver(tmp_path: Path) -> None:
    """By the names of its rules; what it does not name stays, and faults point at its own text."""
    (tmp_path / "base.yaml").write_text(BASE)
    robot = "urc: 1\nkind: robot\nname: robot\ndriver: base.yaml\nsimulator:\n"
    rules = "  wire:\n    - { name: ping, match: '^PING$', send: pong }\n"
    line = EmulatedRobot(profile_of(tmp_path, robot + rules), {}).line("wire")
    said = [line.receive(asked, 0.0)[0] for asked in (b"HELLO\n", b"PING\n")]
    assert said == [b"hi\n", b"pong\n"]
    whole = "  wire:\n    - { match: '^ONLY$', send: this }\n"
    line = EmulatedRobot(profile_of(tmp_path, robot + whole), {}).line("wire")
    assert line.receive(b"HELLO\n", 0.0) == []
    (tmp_path / "robot.yaml").write_text(robot + rules.replace("pong", '"{{ nothing }}"'))
    checked = check(tmp_path / "robot.yaml", built_in_catalog())
    found = [(one.path, one.line, Path(one.file).name) for one in checked.problems]
    assert ("simulator.wire.0.send", 7, "robot.yaml") in found


def test_the_gallery_keeps_what_its_drivers_say() -> None:
    """TurtleBot3's pace is its own, and its room is that of all bases."""
    folder = Path(__file__).parents[3] / "robots"
    world = load_profile(folder / "turtlebot3.yaml", built_in_catalog()).world
    assert world is not None
    assert (world.body.speed, world.laser.max) == (0.22, 3.5)

"""What each robot must be sent, by its protocol's own documents.

A profile's tests hold the sample bytes of the sheet that its heading names; here they are the
oracle for what a browser brings about. Beside them stand the stops, which no sheet has as a sample
but which each defines.
"""

from collections.abc import Iterator, Mapping
from typing import Literal, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.e2e.robots.recording import Overheard
from urc.model.driver import Driver
from urc.model.payload import Envelope
from urc.model.profile import Fed, Profile, pieces_of
from urc.model.values import Reading
from urc.protocol.framing.table import build_framing

__all__ = ["GOODBYES", "STOPS", "Sample", "came", "newest", "samples", "stopped"]


class Sample(NamedTuple):
    """A command and what it must become."""

    command: str
    arguments: Mapping[str, Reading]
    sent: Mapping[str, Fed | tuple[Fed, ...]]
    """Transport → what comes there."""


_ZERO = {"linear": {"x": 0, "y": 0, "z": 0}, "angular": {"x": 0, "y": 0, "z": 0}}
_TWIST = Envelope("publish", {"topic": "/cmd_vel"}, _ZERO)
_ROS = ("absolem", "generic-ros1", "generic-ros2", "spot", "turtlebot3", "turtlebot4")
_STILL = {name: dict.fromkeys("xyz", 0) for name in ("linear", "angular")}
_HEADER = {"stamp": "now", "frame_id": "base_link"}
_JOG = Envelope(
    "publish", {"topic": "/servo_node/delta_twist_cmds"}, {"header": _HEADER, "twist": _STILL}
)
_LEVER = Envelope(
    "publish",
    {"topic": "/servo_node/delta_joint_cmds"},
    {
        "header": _HEADER,
        "joint_names": [
            *("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"),
            *("wrist_1_joint", "wrist_2_joint", "wrist_3_joint"),
        ],
        "displacements": [],
        "velocities": [0] * 6,
        "duration": 0,
    },
)
_SWIMMERS = ("amphibot-ii", "amphibot-iii", "salamandra-i", "salamandra-ii")

_OPENING = (25, 2, 3, 2)
"""Lengths of the frames with which a dongle is opened."""

STOPS: dict[tuple[str, str], Fed] = {
    # SDK 2.0 user guide: "rc a b c d", each from -100 to 100
    ("tello", "fly"): "rc 0 0 0 0",
    # OI specification, Drive Direct: 145 and two velocities, high byte first
    ("create-2", "wheels"): bytes.fromhex("91 00 00 00 00"),
    # MAVLink common.xml, MANUAL_CONTROL: x and r 0, z 500 is the middle
    ("ardupilot-rover", "sticks"): mavlink.MAVLink_manual_control_message(1, 0, 0, 500, 0, 0).pack(
        mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    ),
    # a placeholder, as all words of this console
    ("roveo-mini", "drive"): "DRIVE 0 0",
    # geometry_msgs/Twist: all zeros
    **{(name, "drive"): _TWIST for name in _ROS},
    # moveit_servo: zeros are a command to stand still
    ("ur-ros2", "jog"): _JOG,
    ("ur-ros2", "jog_joints"): _LEVER,
    # remregs: write of 32 bits is 6 << 2, with two bits of the address, then 0.0 as IEEE 754
    **{(name, "swim"): bytes.fromhex("19 10 00 00 00 00") for name in _SWIMMERS},
    **{(name, "steer"): bytes.fromhex("19 11 00 00 00 00") for name in _SWIMMERS},
}
"""Robot and held command → what it must be sent when it is let go."""

_HEADS = {
    "tello": b"rc ",
    "create-2": b"\x91",
    "ardupilot-rover": bytes.fromhex("fd 0b 00 00 00 ff be 45 00 00"),  # message 69
    "roveo-mini": b"DRIVE ",
    **dict.fromkeys(_SWIMMERS, b"\x19\x10"),
}
"""Robot → how every frame begins that makes it move, where that is bytes."""

GOODBYES: dict[str, tuple[str, Fed]] = {
    "tello": ("control", "rc 0 0 0 0"),
    # Drive Direct 0, then Stop: "when you are finished working with the robot"
    "create-2": ("oi", bytes.fromhex("91 00 00 00 00 AD")),
    "roveo-mini": ("console", "DRIVE 0 0"),
    # gpsd_json(5): WATCH with enable false
    "gpsd": ("daemon", '?WATCH={"enable":false};'),
    # dashboard server, article 42728
    "ur-e-series": ("dashboard", "quit"),
}
"""Robot → transport and what must be the last there when the operator goes."""


def samples(profile: Profile) -> Iterator[Sample]:
    """Yield one sample of the sheet for each command that has any."""
    known: dict[str, Sample] = {}
    for test in profile.tests:
        found = [(test.run or "", test.arguments, test.sent)]
        found += [(step.run, step.arguments, step.sent) for step in test.steps]
        for command, arguments, sent in found:
            if command and any(sent.values()) and not test.settings:
                known.setdefault(command, Sample(command, arguments, sent))
    yield from known.values()


def came(
    robot: Overheard, sent: Mapping[str, Fed | tuple[Fed, ...]], mark: Mapping[str, int]
) -> bool:
    """Return whether the robot has got exactly this since `mark`, whatever else it got."""
    return all(
        _place(robot, transport, piece, mark) >= 0
        for transport, pieces in sent.items()
        for piece in pieces_of(pieces)
    )


def stopped(
    robot: Overheard,
    motion: Mapping[str, Fed | tuple[Fed, ...]],
    stop: Fed,
    mark: Mapping[str, int],
) -> bool:
    """Return whether the robot was stopped after the last of `motion`."""
    return all(
        _place(robot, transport, stop, mark) > _place(robot, transport, piece, mark)
        for transport, pieces in motion.items()
        for piece in pieces_of(pieces)
    )


def newest(
    robot: Overheard, transport: str, stop: Fed, mark: Mapping[str, int]
) -> Literal["nothing", "motion", "stop"]:
    """Return what the newest word about a motion is that came since `mark`."""
    if isinstance(stop, Envelope):
        topic = stop.attributes["topic"]
        messages = robot.messages_since(transport, mark)
        found = [one for one in messages if one.attributes.get("topic") == topic]
        if not found:
            return "nothing"
        return "stop" if _is_like(found[-1], stop) else "motion"
    wanted, heard = _both(robot, transport, stop, mark)
    at = heard.rfind(_HEADS[robot.profile.name])
    if at < 0:
        return "nothing"
    return "stop" if heard[at:].startswith(wanted) else "motion"


def _place(robot: Overheard, transport: str, piece: Fed, mark: Mapping[str, int]) -> int:
    """Return where the last one of a piece is among what came since `mark`, or -1."""
    if isinstance(piece, Envelope):
        found = robot.messages_since(transport, mark)
        return max((at for at, one in enumerate(found) if _is_like(one, piece)), default=-1)
    wanted, heard = _both(robot, transport, piece, mark)
    if robot.profile.name in _SWIMMERS and len(wanted) == sum(_OPENING):
        return _in_turn(heard, wanted)
    return heard.rfind(wanted)


def _in_turn(heard: bytes, wanted: bytes) -> int:
    """Return where the last frame of the opening is, when they came in turn; polls lie between."""
    at = begin = 0
    for length in _OPENING:
        at = heard.find(wanted[begin : begin + length], at)
        if at < 0:
            return -1
        begin += length
    return at


def _both(
    robot: Overheard, transport: str, piece: str | bytes, mark: Mapping[str, int]
) -> tuple[bytes, bytes]:
    """Return a piece as it should have come, and all that came since `mark`."""
    wanted = _framed(piece, robot.profile.driver, transport)
    heard = robot.bytes_since(transport, mark)
    if robot.profile.name == "ardupilot-rover":
        wanted, heard = _uncounted(wanted), _uncounted(heard)
    return wanted, heard


def _framed(piece: str | bytes, driver: Driver, transport: str) -> bytes:
    """Return every byte on the wire: bytes are that already."""
    if isinstance(piece, bytes):
        return piece
    spec = driver.transports[transport]
    return build_framing(spec.framing).encode(piece.encode(spec.encoding))


def _uncounted(data: bytes) -> bytes:
    """Return frames of MAVLink without the number that each has, and so without its checksum.

    pymavlink looks at the checksum first, and raises when one is wrong.
    """
    parser = mavlink.MAVLink(None)
    frames = [one.get_msgbuf() for one in parser.parse_buffer(data) or ()]
    return b"".join(bytes((*frame[:4], 0, *frame[5:-2])) for frame in frames)


def _is_like(found: Envelope, wanted: Envelope) -> bool:
    """Return whether a message is the one that is wanted; a sample may leave attributes out."""
    came, given = _addressed(found), _addressed(wanted)
    return (
        found.verb == wanted.verb
        and all(_same(came.get(name), given[name]) for name in given)
        and _same(found.body or None, wanted.body or None)
    )


def _addressed(message: Envelope) -> Mapping[str, object]:
    """Return the attributes; the names of ROS 2 and ROS 1 for a type are the same.

    rosbridge calls a service without its type.
    """
    attributes = dict(message.attributes)
    if message.verb == "call":
        attributes.pop("type", None)
    if "type" in attributes:
        attributes["type"] = str(attributes["type"]).replace("/msg/", "/")
    return attributes


def _same(found: object, wanted: object) -> bool:
    if isinstance(found, Mapping) and isinstance(wanted, Mapping):
        return found.keys() == wanted.keys() and all(
            _same(found[key], wanted[key]) for key in wanted
        )
    if isinstance(found, float) or isinstance(wanted, float):
        return isinstance(found, (int, float)) and abs(found - float(str(wanted))) < 1e-6
    return found == wanted and isinstance(found, bool) == isinstance(wanted, bool)

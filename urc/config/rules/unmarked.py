"""Finds undeclared motion and stops, and autonomous motion without a stop or a confirmation.

Each goal of a moving command also needs a stop that cancels the goal's own action.

A command may suggest motion by its name, by its arguments' units and names, or by its message type.
Only whole words match: ``moves_left`` does not match ``move``.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Final

from urc.config.node import Node, Problems
from urc.model.driver import Command, Driver
from urc.model.payload import WriteSpec, each_of
from urc.model.sequence import SendStep, all_steps
from urc.model.units import quantity_of

__all__ = [
    "check_uncancelled",
    "check_unguarded",
    "check_unmarked",
    "check_unmarked_stop",
    "why_it_moves",
]


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_MOTION: Final = _words(
    "advance climb crawl dive dock drive fly follow goto hover jog jump launch move navigate orbit"
    " reverse roll rotate spin steer swim takeoff turn undock walk"
    " blade drill grind mill mow saw spindle weld"
)
"""Words that suggest motion of the robot or of a tool, at any position in a command's name."""
_FIRST: Final = _words("back backward flip forward go home lift lower raise return")
"""Words that suggest motion at the start of a command's name."""
_PAIRS: Final = frozenset(("go to", "set speed", "set velocity", "take off"))
"""Pairs of words that suggest motion at the start of a command's name."""
_QUIET: Final = _words(
    "abort accept alarm arm brake calibrate cancel clear config configure disable disarm enable end"
    " error feedback finish get gain halt info init lamp led level light limit list load lock log"
    " max min mode name off offset on param pause ping query read reset save select show signal"
    " state status stop store subscribe test timeout trim tune unlock version volume zero"
)
"""Words that rule out motion, such as ``mode`` in ``drive_mode``."""
_STOPS: Final = frozenset(("e stop", "emergency stop", "estop", "halt", "stop", "stop all"))
"""Whole names of commands that stop a robot."""
_BOUND: Final = _words("limit max maximum min minimum top")
"""Words in the names of arguments that limit motion."""
_MOVING_ARGUMENTS: Final = _words("omega rudder steering throttle thrust velocity vx vy vz")
_MOVING_TYPES: Final = _words(
    "AckermannDrive AckermannDriveStamped JointJog JointTrajectory Twist TwistStamped"
)
_QUANTITIES: Final = {"speed": "a speed", "rotation": "a rotation"}
_WORD: Final = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
_HINT: Final = (
    "write hold: { … } for manual motion, moves: true for autonomous motion, stop: true for a"
    " stop, or moves: false for no motion"
)
_HINT_OF_STEPS: Final = (
    "write steps: [ … ] with moves: true for autonomous motion, or moves: false for no motion"
)


def check_unmarked(part: Node, driver: Driver, problems: Problems) -> None:
    """Warn about each command or sequence that suggests motion but does not declare it."""
    for key in ("commands", "sequences"):
        for name, inner in part.named(key).items():
            command = driver.commands[name]
            if command.hold is not None or command.moves or command.stops or _says_no(inner):
                continue
            why = why_it_moves(name, command)
            if why:
                problems.warn(
                    inner,
                    "unmarked-motion",
                    f"{name!r} seems to move the robot or a tool ({why}) but does not declare"
                    " motion: STOP does not block this command",
                    key=True,
                    hint=_HINT if key == "commands" else _HINT_OF_STEPS,
                )


def check_unmarked_stop(part: Node, driver: Driver, problems: Problems) -> None:
    """Warn about a stop of a robot with held commands that STOP does not run.

    If another command is marked with `stop`, its author knows the key.
    """
    commands = driver.commands.values()
    if any(one.stops for one in commands) or all(one.hold is None for one in commands):
        return
    for name, inner in part.named("commands").items():
        command = driver.commands[name]
        is_told = isinstance(inner.data, dict) and "stop" in inner.data
        if is_told or command.hold is not None or command.moves:
            continue
        if " ".join(words_of(name)) in _STOPS:
            problems.warn(
                inner,
                "unmarked-stop",
                f"{name!r} seems to stop the robot, but STOP does not run this command",
                key=True,
                hint="write stop: true, or stop: false if this command must not run at STOP",
            )


def check_unguarded(part: Node, driver: Driver, problems: Problems) -> None:
    """Warn about autonomous motion without a stop command or a confirmation.

    Held commands cause no warning, because their release ends the motion.
    """
    if any(one.stops or one.hold is not None for one in driver.commands.values()):
        return
    for key in ("commands", "sequences"):
        for name, inner in part.named(key).items():
            command = driver.commands[name]
            is_said = isinstance(inner.data, dict) and "moves" in inner.data
            if is_said and command.moves and not _is_asked(command):
                problems.warn(
                    inner.must("moves"),
                    "unguarded-motion",
                    f"{name!r} starts autonomous motion without a stop command and without a"
                    " confirmation",
                    key=True,
                    hint="mark the command that ends the motion with stop: true; if the robot has"
                    " no stop, add 'confirm' to this command",
                )


def check_uncancelled(part: Node, driver: Driver, problems: Problems) -> None:
    """Warn about each moving command with a goal whose action no stop command cancels."""
    ended = [
        found
        for command in driver.commands.values()
        if command.stops
        for found in _actions(command, "cancel")
    ]
    for key in ("commands", "sequences"):
        for name, inner in part.named(key).items():
            command = driver.commands[name]
            if not command.moves or all(one in ended for one in _actions(command, "goal")):
                continue
            problems.warn(
                inner,
                "uncancelled-goal",
                f"{name!r} sends a goal that moves the robot, but no stop command cancels the"
                " goal's action: STOP does not end this goal",
                key=True,
                hint="add a command with stop: true and a 'cancel' of the same action; if the goal"
                " moves nothing, write moves: false",
            )


def _actions(command: Command, verb: str) -> Iterator[tuple[str, object]]:
    """Return the transport and the action of each of a command's frames with this verb."""
    sends: list[tuple[str, WriteSpec]] = [(command.transport, one) for one in each_of(command.send)]
    steps = (step for step in all_steps(command.steps) if isinstance(step, SendStep))
    sends += [(step.transport, one) for step in steps for one in each_of(step.send)]
    for transport, send in sends:
        attributes = send.options.get("attributes")
        if send.options.get("verb") == verb and isinstance(attributes, Mapping):
            yield transport, attributes.get("action")


def _is_asked(command: Command) -> bool:
    return command.confirm is not None or any(one.confirm for one in command.arguments.values())


def _says_no(part: Node) -> bool:
    return isinstance(part.data, dict) and part.data.get("moves") is False


def why_it_moves(name: str, command: Command) -> str:
    """Return why a command suggests motion; "" for other commands."""
    if command.send.options.get("verb") == "cancel":
        return ""  # a cancel ends motion, regardless of its name
    words = words_of(name)
    pair = " ".join(words[:2])
    is_quiet = pair not in _PAIRS and not _QUIET.isdisjoint(words)
    if not is_quiet and (found := pair if pair in _PAIRS else _motion_word(words)):
        return f"its name contains {found!r}"
    for argument in command.arguments.values():
        own = words_of(argument.name)
        if not _BOUND.isdisjoint((*own, *words)):
            continue
        if what := _QUANTITIES.get(quantity_of(argument.unit)):
            return f"its argument {argument.name!r} is {what} in {argument.unit}"
        if not is_quiet and not _MOVING_ARGUMENTS.isdisjoint(own):
            return f"its argument is {argument.name!r}"
    return _type_of_motion(command.send.options)


def words_of(name: str) -> tuple[str, ...]:
    """Return the words of a name such as ``go_to``, ``GoTo`` or ``GO2``, in lower case."""
    return tuple(found[0].lower() for found in _WORD.finditer(name))


def _motion_word(words: tuple[str, ...]) -> str:
    if not words:
        return ""
    if words[0] in _FIRST:
        return words[0]
    return next((one for one in words if one in _MOTION), "")


def _type_of_motion(send: Mapping[str, object]) -> str:
    """Return why a message type suggests motion; "" for other types."""
    attributes = send.get("attributes")
    kind = attributes.get("type") if isinstance(attributes, Mapping) else None
    if not isinstance(kind, str):
        return ""
    own = kind.rpartition("/")[2]
    is_goal = send.get("verb") == "goal" and not _MOTION.isdisjoint(words_of(own))
    return f"it sends a {own}" if is_goal or own in _MOVING_TYPES else ""

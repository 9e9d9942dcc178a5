"""Checks names and arguments in conditions, reply matching and command calls."""

from collections.abc import Iterable, Mapping
from typing import Protocol

from urc.config.autonomous_motion import link_moves, refuse_moving, runs_what_moves
from urc.config.node import Node, Problems
from urc.config.spelling_suggestions import did_you_mean
from urc.config.values import check_within, fit_argument, fit_hint, known_argument
from urc.expressions import COUNTERS, NONCE, NOW, Template
from urc.model.driver import Argument, Command, Driver, Poll, Reply, slowed_arguments
from urc.model.exchange import ErrorReply, ProvisionalReplies, Sight
from urc.model.payload import ReadSpec, WriteSpec

__all__ = [
    "Linker",
    "check_value",
    "find_command",
    "link_arguments",
    "link_command",
    "link_keepalives",
    "link_poll",
    "link_refusals",
    "link_reply",
    "said_on",
]


class Linker(Protocol):
    """The attributes and functions of the link pass that this module needs."""

    driver: Driver
    problems: Problems

    def transport(self, part: Node, key: str, name: str) -> None:
        """Check the transport name under `key`, which is optional if there is one transport."""

    def fields(self, part: Node, read: ReadSpec) -> None:
        """Check that each field is a signal or starts with ``_``."""

    def field(self, part: Node, name: str, place: Mapping[str, int | bool]) -> None:
        """Check the name of one signal that `part` sets."""

    def template(self, part: Node, template: Template, known: Iterable[str] = ()) -> None:
        """Check every name in a template."""

    def templates(self, part: Node, spec: WriteSpec, known: Iterable[str] = ()) -> None:
        """Check the names in every template under ``send:``."""


def link_command(linker: Linker, part: Node, command: Command) -> None:
    """Check the keys of a command, except those of its frame."""
    known = {*linker.driver.signals, *command.arguments}
    if command.reply is not None and "reply" in part.data:
        link_reply(linker, part.must("reply"), command.reply, command.arguments, command.send)
    link_requirements(linker, part, command)
    link_moves(linker.problems, part, command)
    if command.verify is not None:
        linker.template(part.must("verify").must("expr"), command.verify.condition, known)
    if command.hold is not None:
        release = part.must("hold").get("release")
        if release is not None:
            link_arguments(linker.problems, release, command, release.entries(), "release")
        _link_slew(linker.problems, part.must("hold").named("slew"), command)
        if command.hold.sight is not None:
            _link_sight(linker, part.must("hold"), command, command.hold.sight)
        if _needs_two(command):
            linker.problems.error(
                part.must("hold"),
                "wrong-command",
                "a second person cannot approve every new value of a held command",
                key=True,
                hint="require two people for a command that enables the motion",
            )


def _link_slew(problems: Problems, slew: Mapping[str, Node], command: Command) -> None:
    """Check that `slew` limits only numeric arguments without choices."""
    for name, inner in slew.items():
        argument = known_argument(name, inner, command, problems)
        if argument is None:
            continue
        kind = argument.items if argument.type == "array" else argument.type
        if kind not in ("integer", "number") or argument.choices:
            what = "has choices" if argument.choices else f"has the type {kind}"
            text = f"argument {name!r} {what}, so its value cannot change gradually"
            hint = "limit only numeric arguments that have no choices"
            problems.error(inner, "wrong-type", text, key=True, hint=hint)


def _link_sight(linker: Linker, part: Node, command: Command, sight: Sight) -> None:
    """Check that `sees` names an image, and that `slow_after` has a speed to reduce."""
    problems, signals = linker.problems, linker.driver.signals
    inner, signal = part.must("sees"), signals.get(sight.signal)
    if signal is None:
        problems.unknown(inner, "unknown-signal", sight.signal, signals)
    elif signal.type not in ("image", "video"):
        problems.error(
            inner,
            "wrong-type",
            f"signal {sight.signal!r} is of type {signal.type}, which shows the operator nothing",
            hint="name a signal of type image or video",
        )
    if sight.slow_after_s is not None and not slowed_arguments(command):
        problems.error(
            part.must("slow_after"),
            "wrong-command",
            f"{command.name!r} has no speed that could fall with the age of the image",
            hint="leave 'slow_after' out; only numeric arguments without choices are slowed, if"
            " 'release' names them or their default is 0",
        )


def link_requirements(linker: Linker, part: Node, command: Command) -> None:
    """Check the names in the conditions of a command or sequence."""
    known = {*linker.driver.signals, *command.arguments}
    for inner, one in zip(part.listed("requires"), command.requires, strict=True):
        linker.template(inner.must("expr"), one.condition, known)


def refuse_two_person(linker: Linker, part: Node, command: Command) -> None:
    """Report a command that needs two people, because `part` would run it automatically."""
    if _needs_two(command):
        linker.problems.error(
            part,
            "wrong-command",
            f"{command.name!r} needs two people, so it must not run automatically",
            hint="run a command whose 'confirm' has no two_person",
        )


def _needs_two(command: Command) -> bool:
    asked = [one for argument in command.arguments.values() for one in argument.confirm.values()]
    asked += [command.confirm] if command.confirm is not None else []
    return any(one.is_two_person for one in asked)


def link_poll(linker: Linker, part: Node, poll: Poll) -> None:
    """Check the names in a poll, and that its command only reads values."""
    if poll.when is not None:
        linker.template(part.must("when"), poll.when, linker.driver.signals)
    if not poll.run:
        linker.transport(part, "to", poll.transport)
        linker.templates(part.must("send"), poll.send, said_on(linker.driver, poll.transport))
        if poll.reply is not None and "reply" in part.data:
            link_reply(linker, part.must("reply"), poll.reply, (), poll.send)
        return
    command = find_command(linker, part.must("run"), poll.run)
    if command is None:
        return
    if command.steps or command.hold is not None or runs_what_moves(command, poll.arguments):
        what = "a sequence" if command.steps else "a motion command"
        linker.problems.error(
            part.must("run"),
            "wrong-command",
            f"{poll.run!r} is {what}, but a poll may only read values",
            hint="run a command that only reads values",
        )
        return
    link_arguments(linker.problems, part, command, part.named("args"), "run")
    refuse_two_person(linker, part.must("run"), command)


def link_reply(
    linker: Linker, part: Node, reply: Reply, arguments: Iterable[str], send: WriteSpec
) -> None:
    """Check the stages, error replies and counter of a reply."""
    stages = part.listed("stages")
    reads = [reply.read, *(one.read for one in reply.stages)]
    errors = [reply.faults, *(one.faults for one in reply.stages)]
    own = len(_refusal_parts(part)) if stages else 0
    beside = [reply.asides, *(one.asides for one in reply.stages)]
    for place, (inner, read, faults, asides) in enumerate(
        zip(stages or [part], reads, errors, beside, strict=True)
    ):
        linker.fields(inner, read)
        link_asides(linker, inner, asides)
        link_refusals(linker, inner, faults[: len(faults) - own] if stages else faults)
        if stages and not place and own:
            link_refusals(linker, part, faults[-own:])
    if reply.match is None:
        return
    match = part.must("match")
    shared = set.intersection(*(set(read.fields) - set(read.sets) for read in reads))
    linker.template(match, reply.match, {*shared, *arguments, "seq"})
    if "seq" in reply.match.names and COUNTERS not in send.names:
        linker.problems.error(
            match,
            "unknown-counter",
            "the request has no counter",
            offset=reply.match.source.find("seq"),
            length=3,
            hint="write {{ seq('number', 0, 255) }} in place of the counter in the request",
        )


def link_asides(linker: Linker, part: Node, asides: ProvisionalReplies) -> None:
    """Check the provisional replies under ``resend:`` and ``extend:``."""
    for key, read in (("resend", asides.resend), ("extend", asides.extend)):
        inner = part.get(key)
        if inner is not None and read is not None and isinstance(inner.data, dict):
            linker.fields(inner, read)


def link_refusals(linker: Linker, part: Node, faults: tuple[ErrorReply, ...]) -> None:
    """Check the error replies under ``errors:``."""
    for inner, fault in zip(_refusal_parts(part), faults, strict=True):
        linker.fields(inner, fault.read)
        if fault.text is not None:
            linker.template(inner.must("text"), fault.text, fault.read.fields)


def said_on(driver: Driver, transport: str) -> Iterable[str]:
    """Return the names that all templates of a transport may use, such as counters and the time."""
    learnt = driver.learnt(transport) if transport in driver.transports else frozenset()
    return (COUNTERS, NONCE, NOW, *learnt)


def link_keepalives(linker: Linker, part: Node) -> None:
    """Check the keepalive commands of the transports."""
    for name, inner in part.named("transports").items():
        keepalive = linker.driver.transports[name].keepalive
        if keepalive is None:
            continue
        linker.transport(inner, "type", name)  # a keepalive uses the transport
        place = inner.must("keepalive")
        for one in place.listed("after"):
            _link_counting(linker, one, name)
        if keepalive.send is not None:
            linker.templates(place.must("send"), keepalive.send, said_on(linker.driver, name))
            continue
        command = find_command(linker, place.must("run"), keepalive.run)
        if command is not None:
            link_arguments(linker.problems, place, command, {}, "run")
            refuse_two_person(linker, place.must("run"), command)
            refuse_moving(linker.problems, place.must("run"), command, {})


def _link_counting(linker: Linker, part: Node, transport: str) -> None:
    """Check that `part` names a command that can count as traffic for the transport's keepalive."""
    command = find_command(linker, part, str(part.data))
    if command is not None and (command.steps or command.transport != transport):
        what = "is a sequence" if command.steps else f"goes to {command.transport!r}"
        linker.problems.error(
            part,
            "wrong-command",
            f"{command.name!r} {what}, so it cannot keep {transport!r} alive",
            hint="use a command that is sent over this transport",
        )


def find_command(linker: Linker, part: Node, name: str) -> Command | None:
    """Return the command or sequence that `part` names, or report an unknown name."""
    command = linker.driver.commands.get(name)
    if command is None:
        linker.problems.unknown(part, "unknown-command", name, linker.driver.commands)
    return command


def link_arguments(
    problems: Problems, part: Node, command: Command, given: Mapping[str, Node], at: str
) -> None:
    """Check the constant values in `given` for the arguments of `command`.

    A missing argument is reported at the key `at` in `part`.
    """
    for name, inner in given.items():
        argument = known_argument(name, inner, command, problems)
        if argument is not None and not (isinstance(inner.data, str) and "{{" in inner.data):
            check_value(inner, argument, problems)  # a template's value is known only at runtime
    missing = [
        name
        for name, one in command.arguments.items()
        if one.is_required and one.default is None and name not in given
    ]
    if missing:
        where = {"at": at} if isinstance(part.data, dict) and at in part.data else {"key": True}
        problems.error(
            part,
            "missing-argument",
            f"command {command.name!r} needs {missing[0]!r}",
            hint=f"give a value here, or give the argument {missing[0]!r} a default",
            **where,
        )


def check_value(part: Node, argument: Argument, problems: Problems) -> None:
    """Check whether the constant value at `part` is valid for an argument."""
    value = part.data
    try:
        elements = fit_argument(value, argument.type, argument.items, argument.size)
    except ValueError as error:
        text = f"argument {argument.name!r}: {error}"
        problems.error(part, "wrong-type", text, hint=fit_hint(value, argument.type))
        return
    for one in elements:
        check_within(one, argument.min, argument.max, part, problems)
        if argument.choices and one not in argument.choices:
            text = f"{one!r} is not one of the choices of {argument.name!r}"
            hint = did_you_mean(str(one), map(str, argument.choices), "choices")
            problems.error(part, "unknown-word", text, hint=hint)


def _refusal_parts(part: Node) -> list[Node]:
    return [inner for inner in part.listed("errors") if isinstance(inner.data, dict)]

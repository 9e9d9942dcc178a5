"""Rules for transports without replies and for silence as a reply."""

from typing import Final

from urc.config.link.steps import steps_of
from urc.config.node import Node, Problems
from urc.model.driver import Driver, Reply, TransportSpec
from urc.model.sequence import ExpectStep, PromptStep, Step, all_steps

__all__ = ["check_answers"]

_HINT: Final = "remove 'replies: never', or remove the waits for this transport"


def check_answers(part: Node, driver: Driver, problems: Problems) -> None:
    """Check waits on transports without replies, and replies that treat silence as success."""
    for name, inner in part.named("commands").items():
        one = driver.commands[name]
        _check_silence(inner, one.reply, driver.transports.get(one.transport), problems)
    for inner, poll in zip(part.listed("polls"), driver.polls, strict=True):
        _check_silence(inner, poll.reply, driver.transports.get(poll.transport), problems)
    mute = {name for name, spec in driver.transports.items() if spec.never_replies}
    if not mute:
        return
    for name, inner in part.named("transports").items():
        if name in mute:
            _check_line(inner, driver.transports[name], problems)
    for name, inner in part.named("commands").items():
        command = driver.commands[name]
        if command.transport in mute and command.reply is not None:
            _refuse(inner, "reply" if "reply" in inner.data else "send", name, problems)
    for inner, poll in zip(part.listed("polls"), driver.polls, strict=True):
        if poll.transport in mute and poll.reply is not None and "send" in inner.data:
            _refuse(inner, "reply" if "reply" in inner.data else "send", poll.name, problems)
    for name, inner in part.named("messages").items():
        if driver.messages[name].transport in mute:
            problems.error(
                inner,
                "never-replies",
                f"{driver.messages[name].transport!r} receives nothing because of 'replies: never'",
                key=True,
                hint=_HINT,
            )
    for name, inner in part.named("sequences").items():
        _check_steps(steps_of(inner), driver.commands[name].steps, mute, problems)


def _check_silence(
    part: Node, reply: Reply | None, spec: TransportSpec | None, problems: Problems
) -> None:
    """Report a stage that treats silence as success but has no error reply."""
    place = part.get("reply")
    if reply is None or place is None or (spec is not None and (spec.errors or spec.faults)):
        return
    answers = [(reply.read, reply.errors, reply.faults)]
    answers += [(one.read, one.errors, one.faults) for one in reply.stages]
    inners = place.listed("stages") or [place]
    for inner, (read, errors, faults) in zip(inners, answers, strict=True):
        if read.form == "silence" and not (errors or faults):
            problems.error(
                inner,
                "nothing-refuses",
                "silence means success, but no error reply is declared",
                at="silence",
                key=True,
                hint="write the error replies under 'errors', or remove 'reply'",
            )


def _refuse(part: Node, key: str, name: str, problems: Problems) -> None:
    text = f"{name!r} waits for a reply on a transport with 'replies: never'"
    problems.error(part, "never-replies", text, at=key, key=True, hint=_HINT)


def _check_line(part: Node, spec: TransportSpec, problems: Problems) -> None:
    timeouts = part.get("timeouts")
    for place, key in ((part, "stale_after"), (timeouts, "idle")):
        if place is not None and key in place.data:
            text = f"{key!r} waits for the robot on a transport with 'replies: never'"
            problems.error(place, "never-replies", text, at=key, key=True, hint=_HINT)
    for key, steps in (("on_connect", spec.on_connect), ("on_close", spec.on_close)):
        if steps:
            _check_steps(part.must(key), steps, {spec.name}, problems)


def _check_steps(part: Node, steps: tuple[Step, ...], mute: set[str], problems: Problems) -> None:
    for step in all_steps(steps):
        if isinstance(step, (ExpectStep, PromptStep)) and step.transport in mute:
            text = f"a step waits for {step.transport!r}, which has 'replies: never'"
            problems.error(part, "never-replies", text, key=True, hint=_HINT)
            return

"""Parser for queues, rates, conditions, held commands and keepalives."""

import math
from collections.abc import Iterable, Mapping
from typing import Final, Literal, cast

from urc.config.autonomous_motion import parse_moves
from urc.config.messaging import MESSAGING
from urc.config.node import Node, Problems, shown_duration
from urc.config.parse.form import FormContext, parse_write
from urc.config.parse.reply import parse_errors, refuse
from urc.config.parse.steps import StepContext, parse_steps
from urc.config.spelling_suggestions import did_you_mean
from urc.config.values import given
from urc.expressions import compile_template
from urc.model.driver import Argument, Command, Message, Poll, TransportSpec
from urc.model.exchange import (
    Confirm,
    Hold,
    Keepalive,
    Offline,
    Priority,
    Queue,
    Requirement,
    Retry,
    Sight,
    Verify,
)
from urc.model.payload import WriteSpec
from urc.model.role import Role
from urc.model.sequence import MAX_STEP_S, ExpectStep, PromptStep, SendStep, all_steps
from urc.model.values import Reading, Signal, Value

__all__ = [
    "NOTHING_SENT",
    "command_with_flow",
    "line_with_flow",
    "parse_choice_questions",
    "parse_sequence",
    "poll_with_flow",
]

_PER_S: Final = {"s": 1.0, "m": 60.0, "h": 3600.0}
NOTHING_SENT: Final = WriteSpec("text", {"template": compile_template("")})
"""Frame of a sequence: empty, because only the sequence's steps send frames."""


def line_with_flow(
    spec: TransportSpec, part: Node, context: FormContext, problems: Problems
) -> TransportSpec:
    """Return the transport with its queue, keepalive, timeouts, login and close steps."""
    queue = part.get("queue")
    if spec.connection == "per_request":
        refuse(
            part, ("keepalive",), "has no effect, because each request opens a connection", problems
        )
        if queue is not None:
            refuse(
                queue,
                ("in_flight",),
                "is always 1, because each request opens a connection",
                problems,
            )
    if spec.is_half_duplex and queue is not None:
        refuse(queue, ("in_flight",), "is always 1, because the transport is half-duplex", problems)
    timeouts = part.get("timeouts")
    if timeouts is not None and "on_connect" not in part.data:
        refuse(timeouts, ("on_connect",), "has no effect without steps", problems)
    steps = StepContext(spec.name, is_named=False, forms=context)
    on_connect, on_close = part.get("on_connect"), part.get("on_close")
    errors, faults = parse_errors(part, problems, context)
    if queue is not None and spec.type in MESSAGING:
        refuse(queue, ("bytes",), "counts bytes, but this transport carries messages", problems)
    return spec._replace(
        errors=errors,
        faults=faults,
        queue=_queue(queue, spec.type),
        keepalive=_keepalive(part.get("keepalive"), context, problems),
        on_connect=parse_steps(on_connect, steps, problems) if on_connect else (),
        on_close=parse_steps(on_close, steps, problems) if on_close else (),
        stale_after_s=problems.duration(part, "stale_after", 0.0, least=0.05) or None,
    )


def aged_by_lines(
    signals: Mapping[str, Signal],
    transports: Mapping[str, TransportSpec],
    messages: Mapping[str, Message],
    polls: Iterable[Poll],
) -> dict[str, Signal]:
    """Return the signals with the `stale_after` of their transports.

    A signal's own `stale_after` takes precedence. An occupancy grid does not become stale with its
    transport's messages, because a robot may send its map only once.
    """
    ages: dict[str, list[float]] = {}
    frames = [(one.transport, one.read) for one in messages.values()]
    frames += [(one.transport, one.reply.read) for one in polls if one.reply is not None]
    for transport, read in frames:
        spec = transports.get(transport)
        if spec is not None and spec.stale_after_s is not None:
            for name in read.fields:
                ages.setdefault(name, []).append(spec.stale_after_s)
    return {
        name: one._replace(stale_after_s=min(ages[name]))
        if name in ages and not one.stale_after_s and one.type != "occupancy_grid"
        else one
        for name, one in signals.items()
    }


def command_with_flow(command: Command, part: Node, problems: Problems) -> Command:
    """Return the command with its queueing, conditions, motion and retries."""
    hold, confirm, verify = part.get("hold"), part.get("confirm"), part.get("verify")
    retries, retry = _retries(part.get("retries"), problems)
    is_idempotent = part.flag("idempotent", default=False)
    is_asked_again = command.reply is not None and command.reply.is_asked_again
    if retries and not (is_idempotent or is_asked_again):
        problems.error(
            part,
            "not-idempotent",
            "if a reply is lost, the robot may perform the command twice",
            at="retries",
            hint="write idempotent: true if the command can safely run twice, or remove 'retries'",
        )
    if retries and command.reply is None:
        problems.error(
            part, "misplaced-key", "'retries' needs 'reply': a missing reply triggers a retry",
            at="retries", key=True,
        )  # fmt: skip
    if part.text("priority") == "realtime":
        refuse(part, ("coalesce", "rate_limit"), "has no effect with realtime priority", problems)
    if hold is not None:
        refuse(
            part,
            ("moves", "stop"),
            "has no effect with 'hold', which already declares motion",
            problems,
        )
        _refuse_asides(part.get("reply"), problems)
    stops = part.flag("stop", default=False)
    if stops:
        _check_stop(command, part, problems)
    moves, moves_if = parse_moves(part, problems)
    return command._replace(
        priority=cast("Priority", part.text("priority", "realtime" if stops else "normal")),
        is_latest_only=part.text("coalesce") == "latest",
        rate_per_s=_rate(part.get("rate_limit"), problems),
        retries=retries,
        retry=retry,
        is_idempotent=is_idempotent,
        hold=_hold(hold, command, problems) if hold else None,
        moves=moves,
        moves_if=moves_if,
        stops=stops,
        role=_role(part),
        confirm=_confirm(confirm) if confirm else None,
        requires=_requires(part, problems),
        verify=_verify(verify, problems) if verify else None,
    )


def _refuse_asides(reply: Node | None, problems: Problems) -> None:
    """Report `resend` and `extend` in a held command, whose next value follows anyway."""
    for inner in [reply, *reply.listed("stages")] if reply is not None else ():
        why = "has no effect with 'hold', because the next value follows anyway"
        refuse(inner, ("resend", "extend"), why, problems)


def _check_stop(command: Command, part: Node, problems: Problems) -> None:
    """Report keys that would prevent or delay a stop command."""
    moves = () if part.data.get("moves") is False else ("moves",)  # false is the default of a stop
    hindering = (*moves, "confirm", "requires", "coalesce", "rate_limit")
    refuse(part, hindering, "has no effect with 'stop', because nothing may delay a stop", problems)
    if part.text("role", "drive") != "drive":
        problems.error(
            part,
            "misplaced-key",
            "'role' has no effect with 'stop', because STOP requires no role",
            at="role",
            key=True,
            hint="remove 'role', or use a separate command for the stop",
        )
    for name, one in command.arguments.items():
        if one.confirm or (one.is_required and one.default is None):
            what = "asks for confirmation" if one.confirm else "has no default"
            problems.error(
                part,
                "missing-argument",
                f"STOP sends this command without arguments, but {name!r} {what}",
                at="stop",
                key=True,
                hint="use a stop command that needs no arguments",
            )


def poll_with_flow(
    poll: Poll, part: Node, commands: dict[str, Command], problems: Problems
) -> Poll:
    """Return the poll with its command and its period."""
    offline, when = part.get("offline"), part.get("when")
    poll = poll._replace(
        when=problems.expression(when) if when else None,
        priority=cast("Priority", part.text("priority", "low")),
        offline=_offline(offline, problems) if offline else None,
    )
    run = part.get("run")
    if run is None:
        if "send" not in part.data:
            problems.error(
                part, "missing-key", "'send' or 'run' is missing: the poll sends nothing", key=True
            )
        refuse(part, ("args",), "belongs to 'run'", problems)
        return poll
    refuse(part, ("send", "reply", "to"), "has no effect with 'run'", problems)
    poll = poll._replace(run=str(run.data), arguments=_arguments(part))
    command = commands.get(poll.run)
    if command is None:
        return poll  # the link pass reports an unknown name
    defaults = {name: one.default for name, one in command.arguments.items()}
    return poll._replace(
        transport=command.transport,
        send=command.send,
        reply=command.reply,
        arguments={**defaults, **poll.arguments},
    )


def parse_sequence(
    part: Node, title: str, only: str, context: FormContext, problems: Problems
) -> Command:
    """Return a sequence as a command.

    `part` is a list of steps, or a mapping with the key ``steps``. `only` is the name of the
    driver's only transport; "" if the driver has several.
    """
    inner = part.must("steps") if isinstance(part.data, dict) else part
    steps = parse_steps(inner, StepContext(only, is_named=True, forms=context), problems)
    named = [
        step.transport
        for step in all_steps(steps)
        if isinstance(step, (SendStep, ExpectStep, PromptStep)) and step.transport
    ]
    sequence = Command(
        name=part.name,
        transport=named[0] if named else only,
        send=NOTHING_SENT,
        title=title,
        steps=steps,
    )
    if not isinstance(part.data, dict):
        return sequence
    confirm = part.get("confirm")
    return sequence._replace(
        title=part.text("title", title),
        description=part.text("description"),
        moves=part.flag("moves", default=False),
        role=_role(part),
        confirm=_confirm(confirm) if confirm else None,
        requires=_requires(part, problems),
    )


def _arguments(part: Node) -> dict[str, Reading]:
    return {name: given(inner.data) for name, inner in part.named("args").items()}


_NUMBERED_IN_FLIGHT: Final = 16
"""Default limit on requests in flight when replies are matched by number."""


def _queue(part: Node | None, kind: str) -> Queue:
    default = Queue(in_flight=_NUMBERED_IN_FLIGHT if kind in MESSAGING else 1)
    if part is None:
        return default
    return Queue(
        part.integer("in_flight") or default.in_flight,
        part.integer("depth") or default.depth,
        part.integer("bytes"),
    )


def _keepalive(part: Node | None, context: FormContext, problems: Problems) -> Keepalive | None:
    if part is None:
        return None
    given = [key for key in ("send", "run") if key in part.data]
    if len(given) != 1:
        text = "'send' and 'run' cannot be used together" if given else "'send' or 'run' is missing"
        where = {"at": "run"} if given else {}
        problems.error(part, "two-forms" if given else "missing-key", text, key=True, **where)
        return None
    send = part.get("send")
    return Keepalive(
        every_s=problems.duration(part, "every", 1.0, least=0.05),
        run=part.text("run"),
        send=parse_write(send, problems, context) if send else None,
        watchdog_s=problems.duration(part, "watchdog", 0.0) or None,
        after=tuple(str(inner.data) for inner in part.listed("after")),
    )


def _rate(part: Node | None, problems: Problems) -> float | None:
    if part is None:
        return None
    number, _, unit = str(part.data).partition("/")
    rate = float(number) / _PER_S[unit]
    if not 1 / 3600 <= rate <= 1000:
        problems.error(part, "out-of-range", f"expected 1/h to 1000/s, found {part.data}")
        return None
    return rate


def _hold(part: Node, command: Command, problems: Problems) -> Hold:
    repeat_s = problems.duration(part, "repeat", 0.05, least=0.01, most=10)
    lease_s = problems.duration(part, "lease", 0.25, least=0.1, most=1.0)
    release, step = part.get("release"), part.get("step")
    step_s = problems.duration(part, "step", 0.0, least=0.001, most=10) if step else None
    if step is not None:
        text = "has no effect with 'step', because the robot stops itself after each step"
        refuse(part, ("release", "watchdog"), text, problems)
    elif release is None:
        problems.error(
            part,
            "missing-release",
            "'release' or 'step' is missing, so nothing stops the motion",
            key=True,
            hint=f"write release: {_rest_of(command)} with arguments that stop the robot, or 'step'"
            " with the step's duration if the robot stops after each step",
        )
        return Hold(repeat_s)
    entries = release.entries() if release is not None else {}
    values = {name: given(inner.data) for name, inner in entries.items()}
    slew = {name: float(inner.data) for name, inner in part.named("slew").items()}
    on_stall = cast("Literal['abort', 'wait'] | None", part.text("on_stall") or None)
    watchdog_s, sight = _watchdog_s(part, problems), _sight(part, problems)
    return Hold(repeat_s, values, lease_s, watchdog_s, slew, on_stall, step_s, sight)


def _sight(part: Node, problems: Problems) -> Sight | None:
    """Return the image that the operator must see, or None."""
    signal = part.text("sees")
    if not signal:
        why = "has no effect without 'sees', which names the image that the operator must see"
        refuse(part, ("slow_after", "stop_after"), why, problems)
        return None
    if "stop_after" not in part.data:
        problems.error(
            part,
            "missing-key",
            "'stop_after' is missing, so no image would be too old to drive by",
            key=True,
            hint="write the age at which the motion ends, such as stop_after: 700ms",
        )
    stop_s = problems.duration(part, "stop_after", 5.0, least=0.2, most=5.0)
    slow = part.get("slow_after")
    if slow is None:
        return Sight(signal, stop_s)
    slow_s = problems.duration(part, "slow_after", 0.05, least=0.05, most=5.0)
    if slow_s >= stop_s:
        problems.error(
            slow,
            "out-of-range",
            f"expected less than 'stop_after', which is {shown_duration(stop_s)},"
            f" found {shown_duration(slow_s)}",
            hint="the speed falls between both ages; leave 'slow_after' out to keep the speed",
        )
    return Sight(signal, stop_s, slow_s)


def _rest_of(command: Command) -> str:
    """Return an example of `release`: zeros if 0 is in every argument's range, otherwise "…"."""
    ranges = [(one.min, one.max) for one in command.arguments.values()]
    is_both = all(low is not None and high is not None and low < 0 < high for low, high in ranges)
    names = [f"{name}: 0" for name in command.arguments] if is_both else []
    return f"{{ {', '.join(names) or '…'} }}"


def _watchdog_s(part: Node, problems: Problems) -> float | None:
    if part.text("watchdog") == "none":
        return math.inf
    return problems.duration(part, "watchdog", 0.0) or None


def _role(part: Node) -> Role:
    return cast("Role", part.text("role", "drive"))


def _confirm(part: Node) -> Confirm:
    level = cast("Literal['normal', 'hazardous']", part.text("level", "normal"))
    return Confirm(level, part.must("text").data, part.flag("two_person", default=False))


def parse_choice_questions(part: Node, argument: Argument, problems: Problems) -> Argument:
    """Return the argument with the confirmation questions of its choices."""
    asked = part.named("confirm")
    if not asked:
        return argument
    kind = argument.items if argument.type == "array" else argument.type
    words = ["true", "false"] if kind == "boolean" else [_written(one) for one in argument.choices]
    if not words:
        problems.error(
            part,
            "misplaced-key",
            "'confirm' of an argument needs 'choices'",
            at="confirm",
            key=True,
            hint="write choices: […], or put 'confirm' next to 'send' to ask every time",
        )
    for name, inner in asked.items():
        if words and name not in words:
            problems.error(
                inner,
                "unknown-word",
                f"{name!r} is not one of the choices",
                key=True,
                hint=did_you_mean(name, words, "choices"),
            )
    return argument._replace(confirm={name: _confirm(inner) for name, inner in asked.items()})


def _written(value: Value) -> str:
    """Return an argument's choice as the text that a document's key would have."""
    return f"{value:g}" if isinstance(value, float) else str(value)


def _retries(part: Node | None, problems: Problems) -> tuple[int, Retry]:
    """Return the number of retries and the delays before retries."""
    if part is None:
        return 0, Retry()
    if not isinstance(part.data, dict):
        return int(part.data), Retry()
    initial_s = problems.duration(part, "initial", 0.0, most=MAX_STEP_S)
    max_s = problems.duration(part, "max", initial_s, most=MAX_STEP_S)
    if max_s < initial_s:
        problems.error(
            part,
            "wrong-order",
            "'initial' is longer than 'max'",
            at="initial",
            hint="'initial' is the first delay, and 'max' is the longest delay",
        )
    return part.integer("count") or 0, Retry(initial_s, max_s)


def _requires(part: Node, problems: Problems) -> tuple[Requirement, ...]:
    found = []
    for inner in part.listed("requires"):
        condition = problems.expression(inner.must("expr"))
        if condition is not None:
            found.append(Requirement(condition, inner.must("else").data))
    return tuple(found)


def _verify(part: Node, problems: Problems) -> Verify | None:
    condition = problems.expression(part.must("expr"))
    within_s = problems.duration(part, "within", 1.0, most=MAX_STEP_S)
    return None if condition is None else Verify(condition, within_s)


def _offline(part: Node, problems: Problems) -> Offline:
    after = part.integer("after") or 1
    return Offline(after, problems.duration(part, "retry", 10.0, least=0.05))

"""A widget's bindings as JSON for ``cell.js``, ``output.js`` and ``input.js``.

Layer 5. Pure.
"""

from collections.abc import Mapping

from urc.model import sequence
from urc.model.binding import targets
from urc.model.driver import Argument, Command, Driver
from urc.model.exchange import Hold
from urc.model.interface import OutputBinding, WidgetUse
from urc.model.units import conversion
from urc.model.values import Reading
from urc.model.widget import Widget, WidgetPort
from urc.runtime.one_shot_commands import HELD, needs_holding

__all__ = [
    "asked_before",
    "inputs_config",
    "motion_lines",
    "opens_on_demand",
    "output_config",
    "sight_config",
]

_NO_PORT = WidgetPort("")
_NOTHING_GIVEN = OutputBinding()


def inputs_config(use: WidgetUse, widget: Widget, driver: Driver) -> dict[str, object]:
    """Return the inputs' signals and their conversions to the widget's units."""
    bound: dict[str, str | list[str]] = {**use.inputs}
    bound |= {name: list(many) for name, many in use.lists.items()}
    found: dict[str, list[dict[str, object] | None]] = {}
    for name, signals in bound.items():
        port = widget.inputs.get(name, _NO_PORT)
        each = [signals] if isinstance(signals, str) else signals
        scales = [_scale(driver.signals[signal].unit, port.unit) for signal in each]
        if any(scales):
            found[name] = scales
    return {"inputs": bound, "conversions": found}


def _scale(have: str, want: str) -> dict[str, object] | None:
    scale = conversion(have, want) if want and have != want else None
    return scale and {"factor": scale.factor, "offset": scale.offset, "symbol": want}


def output_config(use: WidgetUse, output: str, widget: Widget, driver: Driver) -> dict[str, object]:
    """Return the configuration of one output for ``output.js``."""
    name = use.outputs[output]
    command = driver.commands.get(name)
    port = widget.outputs.get(output, _NO_PORT)
    given = use.given.get(output, _NOTHING_GIVEN)
    hold = command.hold if command is not None else None
    is_held = hold is not None and port.is_held
    return {
        "command": name,
        "names": targets(command, port, given) if command is not None else dict(given.names),
        "fixed": dict(given.fixed),
        "ranges": _ranges(command, port, given) if is_held else {},
        "neutral": _neutral(command, port, given) if is_held else {},
        "line": _line(command, driver),
        "refusal": HELD if needs_holding(driver, name) and not is_held else "",
        "isHeld": is_held,
        "moves": command is not None and _moves(command, given),
        "role": command.role if command is not None else "drive",
        "mayMove": command is not None and command.moves,
        "leaseMs": round(hold.lease_s * 1000) if hold is not None else 0,
        "sees": sight_config(hold),
        "title": (command and command.title) or "",
        "arguments": _arguments(command, given),
        "asks": asked_before(command),
        "steps": [_step_words(one) for one in command.steps] if command is not None else [],
        "isAnswered": command is not None and (command.reply is not None or bool(command.steps)),
    }


def sight_config(hold: Hold | None) -> dict[str, object] | None:
    """Return the image that a held command requires, for ``shown_images.js``; None if none."""
    if hold is None or hold.sight is None:
        return None
    signal, stop_s, slow_s = hold.sight
    slow_ms = None if slow_s is None else round(slow_s * 1000)
    return {"signal": signal, "stopMs": round(stop_s * 1000), "slowMs": slow_ms}


def _moves(command: Command, given: OutputBinding) -> bool:
    """Return whether the command with these fixed arguments always starts autonomous motion.

    If the motion depends on the operator's choice of a value, the server checks the value.
    """
    condition = command.moves_if
    is_told = condition is None or condition.names <= given.fixed.keys()
    return is_told and command.moves_with(given.fixed)


def _arguments(command: Command | None, given: OutputBinding) -> dict[str, dict[str, object]]:
    """Return the arguments without a fixed value, keyed by name."""
    found: dict[str, dict[str, object]] = {}
    for name, one in (command.arguments if command is not None else {}).items():
        if name not in given.fixed:
            found[name] = {
                "type": one.type,
                "title": one.title or "",
                "unit": one.unit,
                "min": one.min,
                "max": one.max,
                "choices": list(one.choices),
                "default": one.default
                if isinstance(one.default, (bool, int, float, str))
                else None,
                "allowsControl": one.allows_control,
            }
    return found


def asked_before(command: Command | None) -> list[dict[str, object]]:
    """Return the confirmations required for a command and for individual argument values."""
    if command is None:
        return []
    asked = [] if command.confirm is None else [("", "", command.confirm)]
    for name, argument in command.arguments.items():
        asked += [(name, value, confirm) for value, confirm in argument.confirm.items()]
    return [
        {
            "argument": argument,
            "value": value,
            "text": confirm.text or command.title or command.name,
            "level": confirm.level,
            "isTwoPerson": confirm.is_two_person,
        }
        for argument, value, confirm in asked
    ]


def motion_lines(driver: Driver) -> list[str]:
    """Return the transports of commands that stop motion, without duplicates."""
    stopping = [one for one in driver.commands.values() if one.hold is not None or one.stops]
    lines = [one.transport for one in stopping]
    return list(dict.fromkeys(lines))


def _line(command: Command | None, driver: Driver) -> str:
    """Return the transport whose loss disables the command; "" if there is no such transport."""
    line = command.transport if command else ""
    return "" if opens_on_demand(line, driver) else line


def opens_on_demand(transport: str, driver: Driver) -> bool:
    """Return whether only commands open the transport.

    The loss of such a transport disables no controls, because the next command reopens the
    transport.
    """
    spec = driver.transports.get(transport)
    is_polled = any(poll.transport == transport for poll in driver.polls)
    return spec is not None and spec.connection == "per_request" and not is_polled


def _ranges(
    command: Command | None, port: WidgetPort, given: OutputBinding
) -> dict[str, dict[str, object]]:
    """Return the minimum, maximum and neutral value of each argument set by a stick or slider."""
    if command is None:
        return {}
    found: dict[str, dict[str, object]] = {}
    for target, source in targets(command, port, given).items():
        argument = command.arguments.get(target)
        if argument is None or source not in port.arguments or argument.max is None:
            continue
        least = argument.min if argument.min is not None else -argument.max
        found[target] = {
            "min": least,
            "max": argument.max,
            "rest": _rest(command, argument, least),
            "isWhole": argument.type == "integer",
        }
    return found


def _rest(command: Command, argument: Argument, least: float) -> float:
    stop = _release_of(command).get(argument.name, argument.default)
    is_number = isinstance(stop, (int, float)) and not isinstance(stop, bool)
    return float(stop) if is_number else max(0.0, least)  # type: ignore[arg-type]  # a number


def _neutral(command: Command | None, port: WidgetPort, given: OutputBinding) -> dict[str, Reading]:
    """Return the argument values with which the command stops this output's motion."""
    if command is None:
        return {}
    release = _release_of(command)
    return {name: release[name] for name in targets(command, port, given) if name in release}


def _release_of(command: Command) -> Mapping[str, Reading]:
    return command.hold.release if command.hold is not None else {}


def mark(text: str) -> str:
    """Return `text`.

    The function only marks the text for translation; the page translates the text.
    """
    return text


def _step_words(step: sequence.Step) -> dict[str, str]:
    """Return a step's name as a catalogue key and the value for its ``{what}``."""
    match step:
        case sequence.RunStep(command):
            return {"text": mark("run {what}"), "what": command}
        case sequence.SendStep():
            return {"text": mark("send"), "what": ""}
        case sequence.ExpectStep():
            return {"text": mark("wait for the reply"), "what": ""}
        case sequence.PromptStep():
            return {"text": mark("wait for the prompt"), "what": ""}
        case sequence.WaitStep(seconds):
            return {"text": mark("wait {what} s"), "what": f"{seconds:g}"}
        case sequence.UntilStep(condition):
            return {"text": mark("wait until {what}"), "what": condition.source}
        case sequence.RepeatStep(_, times):
            return {"text": mark("repeat up to {what} times"), "what": str(times)}
        case sequence.SetStep(values):
            return {"text": mark("set {what}"), "what": ", ".join(values)}
        case sequence.IfStep(condition):
            return {"text": mark("if {what}"), "what": condition.source}
        case sequence.FailStep():
            return {"text": mark("fail"), "what": ""}

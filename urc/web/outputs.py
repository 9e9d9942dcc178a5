"""What the page must know of a binding: ``output.js`` and ``input.js`` read it.

Floor 5. Pure.
"""

from collections.abc import Mapping

from urc.model.driver import Argument, Command, Driver
from urc.model.interface import Given, WidgetUse
from urc.model.values import Reading
from urc.model.widget import Port, Widget
from urc.web.robots import HELD, needs_holding

__all__ = ["motion_lines", "output_config"]

_NO_PORT = Port("")
_NOTHING_GIVEN = Given()


def output_config(use: WidgetUse, output: str, widget: Widget, driver: Driver) -> dict[str, object]:
    """Return the binding of one output."""
    name = use.outputs[output]
    command = driver.commands.get(name)
    port = widget.outputs.get(output, _NO_PORT)
    given = use.given.get(output, _NOTHING_GIVEN)
    hold = command.hold if command is not None else None
    is_held = hold is not None and port.is_held
    return {
        "command": name,
        "names": _targets(command, port, given) if command and is_held else dict(given.names),
        "fixed": dict(given.fixed),
        "ranges": _ranges(command, port, given),
        "neutral": _neutral(command, port, given) if is_held else {},
        "line": _line(command, driver),
        "refusal": HELD if needs_holding(driver, name) and not is_held else "",
        "isHeld": is_held,
        "leaseMs": round(hold.lease_s * 1000) if hold is not None else 0,
        "isAnswered": command is not None and (command.reply is not None or bool(command.steps)),
    }


def motion_lines(driver: Driver) -> list[str]:
    """Return the transports that carry motion, each once."""
    lines = [one.transport for one in driver.commands.values() if one.hold is not None]
    return list(dict.fromkeys(lines))


def _line(command: Command | None, driver: Driver) -> str:
    """Return the transport without which a command cannot be given."""
    line = command.transport if command else ""
    spec = driver.transports.get(line)
    # A line that is only made for a command is tried again by the next command, and by nothing
    # else: one that is lost must not keep anybody from giving it.
    is_made_for_it = (
        spec is not None
        and spec.connection == "per_request"
        and not any(poll.transport == line for poll in driver.polls)
    )
    return "" if is_made_for_it else line


def _targets(command: Command, port: Port, given: Given) -> dict[str, str]:
    """Return argument of the command → argument of the output that moves it."""
    renamed = set(given.names.values())
    own = {
        name: name for name in port.arguments if name in command.arguments and name not in renamed
    }
    return {**own, **given.names}


def _ranges(command: Command | None, port: Port, given: Given) -> dict[str, dict[str, object]]:
    """Return what -1 to 1 of the widget means for each argument that has a range of its own."""
    if command is None:
        return {}
    found: dict[str, dict[str, object]] = {}
    for target, source in _targets(command, port, given).items():
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
    return float(stop) if is_number else max(0.0, least)  # type: ignore[arg-type]  # it is one


def _neutral(command: Command | None, port: Port, given: Given) -> dict[str, Reading]:
    """Return the values that stop what this output moves, where the command says them."""
    if command is None:
        return {}
    release = _release_of(command)
    return {name: release[name] for name in _targets(command, port, given) if name in release}


def _release_of(command: Command) -> Mapping[str, Reading]:
    return command.hold.release if command.hold is not None else {}

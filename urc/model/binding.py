"""Where the values go that an output of a widget gives. Pure.

What checks a binding and what tells the page of it both ask here, so that they agree.
"""

from urc.model.driver import Command
from urc.model.interface import Given
from urc.model.widget import Port

__all__ = ["targets"]


def targets(command: Command, port: Port, given: Given) -> dict[str, str]:
    """Return argument of the command → argument of the output whose value it takes.

    A value goes where the binding says, else to the argument of its own name; the only value that
    is not held goes to the only argument that is not set, whatever the two are called.
    """
    open_ones = [name for name in command.arguments if name not in given.fixed]
    if not port.is_held and not given.names and len(port.arguments) == 1 and len(open_ones) == 1:
        return {open_ones[0]: port.arguments[0]}
    renamed = set(given.names.values())
    own = {
        name: name for name in port.arguments if name in command.arguments and name not in renamed
    }
    return {**own, **given.names}

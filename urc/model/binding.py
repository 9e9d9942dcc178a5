"""The mapping of a widget's output values to a command's arguments. Pure.

The loader and the dashboard both call `targets`, so both map output values in the same way.
"""

from urc.model.driver import Command
from urc.model.interface import OutputBinding
from urc.model.widget import WidgetPort

__all__ = ["targets"]


def targets(command: Command, port: WidgetPort, given: OutputBinding) -> dict[str, str]:
    """Return the name of the output value for each command argument that receives a value.

    An explicit binding takes precedence. Without a binding, a value is passed to the argument of
    the same name. A single output value is passed to the command's only free argument, even if the
    names differ. Values of hold-to-run controls are passed only to arguments of the same name.
    """
    open_ones = [name for name in command.arguments if name not in given.fixed]
    if not port.is_held and not given.names and len(port.arguments) == 1 and len(open_ones) == 1:
        return {open_ones[0]: port.arguments[0]}
    renamed = set(given.names.values())
    own = {
        name: name for name in port.arguments if name in command.arguments and name not in renamed
    }
    return {**own, **given.names}

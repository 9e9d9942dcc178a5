"""The look that is made for a profile, as a document would write it."""

from urc.config.sources import Sources
from urc.model.interface import Grid, Interface, WidgetUse
from urc.model.profile import Profile

__all__ = ["made_look"]


def made_look(sources: Sources, profile: Profile | None) -> dict[str, object]:
    """Return ``widgets`` and ``interfaces``, those of them that the documents leave out."""
    if profile is None or sources.interfaces:
        return {}
    made: dict[str, object] = {}
    if not sources.slots and profile.slots:
        made["widgets"] = {slot: _use(use) for slot, use in profile.slots.items()}
    if sources.kind == "robot" and profile.slots:
        made["interfaces"] = {name: _interface(one) for name, one in profile.interfaces.items()}
    return made


def _use(use: WidgetUse) -> dict[str, object]:
    bind: dict[str, object] = {**use.inputs}
    bind |= {name: list(many) for name, many in use.lists.items()}
    bind |= {name: _output(use, name) for name in use.outputs}
    written: dict[str, object] = {"use": use.widget, "bind": bind}
    return written | ({"title": use.title} if use.title else {})


def _output(use: WidgetUse, name: str) -> object:
    given = use.given.get(name)
    command = use.outputs[name]
    if given is None or not given.names:
        return command
    return {"command": command, "args": {source: target for target, source in given.names.items()}}


def _interface(interface: Interface) -> dict[str, object]:
    grids = {screen: _picture(grid) for screen, grid in interface.grids.items()}
    return {"title": interface.title, "grids": grids}


def _picture(grid: Grid) -> str:
    rows = [["."] * grid.columns for _ in range(grid.rows)]
    for slot in grid.slots:
        for row in range(slot.row, slot.row + slot.row_span):
            for column in range(slot.column, slot.column + slot.column_span):
                rows[row][column] = slot.name
    width = max(len(name) for row in rows for name in row)
    return "".join("  ".join(name.ljust(width) for name in row).rstrip() + "\n" for row in rows)

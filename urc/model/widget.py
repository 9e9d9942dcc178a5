"""Widgets: what a folder's manifest says a graphic part takes and gives."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from urc.model.values import NOTHING

__all__ = ["Port", "Widget"]


class Port(NamedTuple):
    """An input or output of a widget."""

    name: str
    types: tuple[str, ...] = ("number",)
    """Signal types it accepts; of an output, types of the values it gives; () for any."""
    unit: str = ""
    """Unit it wants; "" takes any."""
    quantity: str = ""
    """Of an input: kind of unit it wants, in which values come as they are; "" takes any."""
    unit_of: str = ""
    """Input or output of the same widget that has to have the same unit; "" for none."""
    is_required: bool = True
    description: str = ""
    is_held: bool = False
    """Of an output: it is given by holding, so it may be bound to motion, and to nothing else."""
    arguments: tuple[str, ...] = ()
    """Of an output: names of the values that it gives along; of a held one each from -1 to 1."""
    of: tuple[str, ...] = ()
    """Of an input that takes arrays: kinds of the elements it can show; () takes any."""
    size: int | None = None
    """Of an input that takes arrays: how many elements they must have; None takes any."""
    is_many: bool = False
    """Of an input: it takes a list of signals, each of which must fit."""
    is_each: bool = False
    """Of an input: each reading counts, not only the newest."""
    instead_of: tuple[str, ...] = ()
    """Of an input: inputs and options of the same widget that mean nothing where it is bound."""


class Widget(NamedTuple):
    """A widget as its ``widget.yaml`` declares it."""

    name: str
    """Equal to the folder's name."""
    title: str
    folder: Path
    inputs: Mapping[str, Port] = NOTHING
    outputs: Mapping[str, Port] = NOTHING
    options: Mapping[str, object] = NOTHING
    """JSON Schema ``properties`` of its options."""
    needs: tuple[str, ...] = ()
    """Inputs, outputs and options of which at least one must be given; () for none."""
    together: tuple[tuple[str, ...], ...] = ()
    """Inputs or outputs that mean something only when all of a group are bound."""
    min_cells: tuple[int, int] = (1, 1)
    """Columns, rows."""
    is_gate: bool = False
    """Whether it is a dead-man: while it does not stand, nothing is driven."""
    summary: str = ""
    licence: str = ""
    """SPDX identifier, as the manifest says."""
    author: str = ""

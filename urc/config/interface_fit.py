"""Checks whether a user's interface fits a robot."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from urc.config.gather import gather
from urc.config.link.interface import link_interface
from urc.config.node import Problems
from urc.config.parse.interface import parse_interface
from urc.config.parse.widget import WidgetFolder
from urc.model.interface import Interface
from urc.model.profile import Profile
from urc.model.values import NOTHING
from urc.model.widget import Widget
from urc.problems import has_errors

__all__ = ["InterfaceFit", "fit_interface"]


class InterfaceFit(NamedTuple):
    """The linked interface and its widgets, or the reason why the interface does not fit."""

    interface: Interface | None
    """The linked interface; None if the interface does not fit."""
    widgets: Mapping[str, Widget] = NOTHING
    """All widgets of the interface, by name."""
    fault: str = ""
    """Reason why the interface does not fit, on one line; "" if the interface fits."""


class _CombinedWidgets(WidgetFolder):
    """The widgets of a profile and of a folder; the profile takes precedence."""

    def __init__(self, widgets: Mapping[str, Widget], behind: WidgetFolder) -> None:
        super().__init__(Path())
        self._mine = widgets
        self._behind = behind
        self.problems = behind.problems

    def names(self) -> list[str]:
        """Return the names of all widgets."""
        return sorted({*self._mine, *self._behind.names()})

    def get(self, name: str) -> Widget | None:
        """Return the widget `name`, from the profile or the folder; None for an unknown name."""
        return self._mine.get(name) or self._behind.get(name)

    def has(self, name: str) -> bool:
        """Return whether a widget has this name."""
        return name in self._mine or self._behind.has(name)


def fit_interface(path: str, profile: Profile, registry: WidgetFolder) -> InterfaceFit:
    """Link an interface to the slots of a robot.

    Args:
        path: path of the interface's document.
        profile: profile of the robot.
        registry: additional widgets; the robot's own widgets take precedence.
    """
    gathered = gather(path)
    sources = gathered.sources
    if sources is None or sources.kind != "interface":
        faults = [one.message for one in gathered.problems if one.severity == "error"]
        return InterfaceFit(None, fault=next(iter(faults), "the document is not an interface"))
    problems = Problems()
    interface = parse_interface(sources.root, sources.root.text("name"), problems)
    known = _CombinedWidgets(profile.widgets, registry)
    if not has_errors(problems):
        interface = link_interface(
            sources.root, interface, profile.slots, profile.driver, known, problems
        )
    errors = [one.message for one in (*problems, *registry.problems) if one.severity == "error"]
    if errors:
        return InterfaceFit(None, fault=errors[0])
    uses = {
        name: interface.widgets.get(name) or profile.slots.get(name) for name in interface.shown
    }
    widgets = {use.widget: known.get(use.widget) for use in uses.values() if use is not None}
    if not widgets:
        return InterfaceFit(None, fault="this robot has no widget for any slot of the interface")
    return InterfaceFit(interface, {name: one for name, one in widgets.items() if one is not None})

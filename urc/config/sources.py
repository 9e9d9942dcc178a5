"""The parts of a profile, with the document of each part.

The driver and the interfaces of a robot may be in separate documents.
"""

from typing import Final

from urc.config.compose.merge import Tree, merge
from urc.config.node import Node
from urc.source import Document

__all__ = ["RESERVED", "Sources"]

_EMULATED: Final = ("signals", "state", "world")
"""Simulator keys for the initial values and the world."""
RESERVED: Final = (*_EMULATED, "rules")
"""Reserved simulator keys, which cannot be names of transports."""


class Sources:
    """The parts of a profile, each with its document and path."""

    def __init__(self, root: Node, kind: str) -> None:
        self.root = root
        self.kind = kind
        self.driver = root
        """Mapping with the keys of the driver, such as ``transports`` and ``commands``."""
        self.settings: dict[str, Node] = {}
        self.slots: dict[str, list[Node]] = {}
        """Widget declarations by slot; later declarations override earlier declarations."""
        self.interfaces: dict[str, Node] = {}
        self.tests: list[Node] = []
        self.simulator: dict[str, Node] = {}
        """Initial values and world of the emulated robot, by key."""
        self.rules: dict[str, Node] = {}
        """Rules of the emulated robot, by transport."""

    def add(self, part: Node) -> None:
        """Add the settings, widgets, tests and simulator of `part`, overriding earlier parts."""
        self.settings |= part.named("settings")
        for slot, use in part.named("widgets").items():
            self.slots.setdefault(slot, []).append(use)
        self.tests += part.listed("tests")
        simulator = part.get("simulator")
        if simulator is None:
            return
        for key in _EMULATED:
            inner = simulator.get(key)
            if inner is not None:
                self.simulator[key] = _over(self.simulator.get(key), inner)
        rules = {name: one for name, one in simulator.entries().items() if name not in RESERVED}
        for name, inner in (rules | simulator.named("rules")).items():
            self.rules[name] = _over(self.rules.get(name), inner)


def _over(below: Node | None, part: Node) -> Node:
    """Merge a part of a simulator into the driver's simulator; the new values take precedence."""
    if below is None:
        return part
    merged = merge(_tree(below), _tree(part), part.path)
    home, value, mark = merged.home, merged.value, merged.mark
    for key in reversed(part.path):
        value, mark = {key: value}, mark.copy({key: mark})
    document = Document(home.file, home.text, home.lines, value, mark)
    return Node(document, part.path, merged.value)


def _tree(part: Node) -> Tree:
    mark = part.document.at(part.path)
    assert mark is not None, part.path  # noqa: S101  # every existing value has a mark
    return Tree(part.data, mark, part.document.source_of(part.path))

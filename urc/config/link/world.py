"""Checks the names in an emulated robot's world and the ``world`` readings in its rules."""

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from urc.config.link.flow import Linker
from urc.config.link.rules import settable
from urc.config.node import Node, Problems
from urc.config.spelling_suggestions import did_you_mean
from urc.expressions import Template
from urc.model.driver import Driver
from urc.model.world import READINGS, Failsafe, WorldSpec

__all__ = ["check_readings", "link_world"]

_READING: Final = re.compile(r"_item\(ns\['world'\], '(\w+)'\)(?:, '(\w+)'\))?")
"""Pattern for ``world.NAME`` and ``world.NAME.PART`` in a compiled template."""


def link_world(
    linker: Linker, part: Node, spec: WorldSpec, state: Iterable[str], parts: Mapping[str, Node]
) -> WorldSpec:
    """Check every name in a world; return the world with the commands that reset its watchdog.

    `state` contains the names of the emulated robot's state. `parts` contains the simulator's
    nodes.
    """
    driver, problems, own = linker.driver, linker.problems, {*state}
    known = {"now", "world", *own, *driver.signals}
    for place, template in _templates(part, spec):
        linker.template(place, template, known)
    if "world" in driver.signals:
        text = "a signal has the name 'world', so expressions would be ambiguous"
        problems.error(part, "duplicate-name", text, key=True, hint="rename the signal")
    _link_signals(part, driver, problems, parts)
    if spec.failsafe is None:
        return spec
    return spec._replace(failsafe=_link_failsafe(part.must("failsafe"), spec.failsafe, linker, own))


def check_readings(problems: Problems, part: Node, template: Template) -> None:
    """Report each unknown name after ``world.`` in a template."""
    for name, inner in _READING.findall(template.python):
        if name not in READINGS:
            text, hint = f"the world has no {name!r}", did_you_mean(name, READINGS, "readings")
            problems.error(part, "unknown-name", text, hint=hint)
        elif READINGS[name] and inner not in READINGS[name]:
            text = f"world.{name} has no {inner!r}" if inner else f"world.{name} has several parts"
            hint = did_you_mean(inner, READINGS[name], "parts")
            problems.error(part, "unknown-name", text, hint=hint)


def _templates(part: Node, spec: WorldSpec) -> Iterator[tuple[Node, Template]]:
    for key, values in (("drive", spec.drive), ("signals", spec.senses)):
        for name, inner in part.named(key).items():
            value = values.get(name)
            if isinstance(value, Template):
                yield inner, value
    for key in ("flip", "mirror"):
        value = getattr(spec.camera, key)
        if isinstance(value, Template):
            yield part.must("camera").must(key), value
    if spec.failsafe is not None:
        for name, inner in part.must("failsafe").named("set").items():
            new = spec.failsafe.sets[name]
            if isinstance(new, Template):
                yield inner, new


def _link_signals(
    part: Node, driver: Driver, problems: Problems, parts: Mapping[str, Node]
) -> None:
    begun = parts["signals"].data if "signals" in parts else {}
    for name, inner in part.named("signals").items():
        if settable(name, inner, driver, problems) is not None and name in begun:
            text = f"the world also sets the signal {name!r}"
            hint = "remove the signal here, or from the world"
            problems.error(parts["signals"], "two-sources", text, at=name, key=True, hint=hint)


def _link_failsafe(part: Node, spec: Failsafe, linker: Linker, state: set[str]) -> Failsafe:
    driver, problems = linker.driver, linker.problems
    for place, name in enumerate(spec.without):
        if name not in driver.commands:
            text = f"there is no command {name!r}"
            hint = did_you_mean(name, driver.commands, "commands")
            inner = part.must("without").items()[place]
            problems.error(inner, "unknown-command", text, hint=hint)
    for name, inner in part.named("set").items():
        if name not in state:
            settable(name, inner, driver, problems)
    held = tuple(name for name, one in driver.commands.items() if one.hold is not None)
    without = spec.without or held
    if not without:
        text = "the driver has no held command that could reset this watchdog"
        problems.error(part, "missing-key", text, key=True, hint="write without: [COMMAND]")
    return spec._replace(without=without)

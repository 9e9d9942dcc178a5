"""Runs the passes that convert YAML documents to the model and collects their problems.

The order of the passes is: compose, expand, shape, parse, link, rules. Each pass reports all
problems that it finds. Each pass runs only if all earlier passes found no errors. Warnings do not
stop a pass.
"""

from collections.abc import Iterable
from os import PathLike, fspath
from typing import NamedTuple

from urc.config.default_look import automatic_slots, default_interface
from urc.config.gather import gather
from urc.config.link.driver import link_driver, link_simulator
from urc.config.link.interface import link_interface, link_slots
from urc.config.link.resources import find_picture
from urc.config.link.tests import link_test
from urc.config.node import Problems
from urc.config.parse.driver import parse_driver, spoken_name
from urc.config.parse.interface import check_names, parse_interface
from urc.config.parse.profile import parse_setting, parse_tags
from urc.config.parse.simulator import SimulatorSpec, parse_simulator
from urc.config.parse.test import parse_test
from urc.config.parse.widget import WidgetFolder, parse_widget
from urc.config.rules.profile import check_profile
from urc.config.sources import Sources
from urc.model.driver import Driver
from urc.model.interface import Interface, WidgetUse
from urc.model.profile import DocumentTest, Profile, Setting
from urc.model.widget import Widget
from urc.problems import Problem, ProblemsError, has_errors
from urc.registry import Registries
from urc.shipped import shipped

__all__ = ["CheckResult", "WidgetFolder", "check", "load_profile"]


class CheckResult(NamedTuple):
    """The result of checking a document: its problems, and what it declares."""

    profile: Profile | None
    """The profile of a robot or driver without errors; a driver gets the default interface."""
    problems: tuple[Problem, ...]
    kind: str
    """Document kind: ``robot``, ``driver``, ``interface`` or ``widget``; "" if it is unknown."""
    files: tuple[str, ...] = ()
    """Paths of all requested files, including missing files; the checked document comes first."""
    pages: tuple[str, ...] = ()
    """URLs of web pages in the widgets, as written in the document."""
    widget: Widget | None = None
    """The widget of a valid manifest; None for other documents and invalid manifests."""
    is_cut_short: bool = False
    """Whether later passes, which might find more problems, did not run because of an error."""


def load_profile(
    path: str | PathLike[str], catalog: Registries, registry: WidgetFolder | None = None
) -> Profile:
    """Return the profile of a robot's or driver's document.

    Raises:
        ProblemsError: the document has errors; the exception contains them.
    """
    checked = check(path, catalog, registry)
    if checked.profile is not None:
        return checked.profile
    if not has_errors(checked.problems):
        if checked.kind in ("robot", "driver"):
            text = (
                f"this is a partial {checked.kind}, which only other documents can include or"
                " extend"
            )
            raise ProblemsError([Problem("partial-document", text, fspath(path))])
        raise ProblemsError(
            [
                Problem(
                    "wrong-kind",
                    f"expected a document of kind 'robot', found kind '{checked.kind}'",
                    fspath(path),
                ),
            ]
        )
    errors = [problem for problem in checked.problems if problem.severity == "error"]
    raise ProblemsError(errors)


def check(
    path: str | PathLike[str], catalog: Registries, registry: WidgetFolder | None = None
) -> CheckResult:
    """Check a document of any kind and its references.

    Args:
        path: path of the document, as shown in problems.
        catalog: the available transports and framings.
        registry: the available widgets; by default the widgets that ship with URC.
            If several calls share a registry, each manifest is read only once.
    """
    path = fspath(path)
    sources, reported, kind, files = gather(path)
    if sources is None:
        is_short = any(one.severity == "error" and one.code != "no-such-file" for one in reported)
        return CheckResult(None, tuple(_told_once(reported)), kind, files, is_cut_short=is_short)
    registry = registry or WidgetFolder(shipped("widgets"))
    problems = Problems()
    profile: Profile | None = None
    widget: Widget | None = None
    uses: list[WidgetUse] = []
    if sources.kind == "widget":
        widget = parse_widget(sources.root.document, problems)
    elif sources.kind == "interface":
        interface = parse_interface(sources.root, sources.root.text("name"), problems)
        if not has_errors(problems):
            interface = link_interface(sources.root, interface, {}, None, registry, problems)
            uses += interface.widgets.values()
    else:
        profile = _profile(sources, catalog, registry, problems)
    if profile is not None:
        uses += profile.uses()
    reported += sorted(problems, key=lambda one: (one.file != path, one.file, one.line, one.column))
    reported += registry.problems
    reported = _told_once(reported)
    is_short = has_errors(reported)
    if is_short:
        profile, widget = None, None
    every = (*files, *registry.files)
    return CheckResult(
        profile, tuple(reported), sources.kind, every, _pages(uses), widget, is_short
    )


def _pages(uses: Iterable[WidgetUse]) -> tuple[str, ...]:
    return tuple(sorted({url for use in uses for many in use.pages.values() for url in many}))


def _told_once(problems: Iterable[Problem]) -> list[Problem]:
    """Return the problems without the duplicates caused by the copies of an `each` item."""
    paths: dict[tuple[str, str, int, int], str] = {}
    return [
        problem
        for problem in dict.fromkeys(problems)
        if paths.setdefault(
            (problem.code, problem.file, problem.line, problem.column), problem.path
        )
        == problem.path
    ]


class _Parsed(NamedTuple):
    driver: Driver
    settings: dict[str, Setting]
    interfaces: dict[str, Interface]
    tests: list[DocumentTest]
    simulated: SimulatorSpec
    tags: tuple[str, ...]


def _profile(
    sources: Sources, catalog: Registries, registry: WidgetFolder, problems: Problems
) -> Profile | None:
    driver = parse_driver(sources.driver, problems, catalog)
    if sources.kind == "robot":
        check_names(sources.root, problems)
    parsed = _Parsed(
        driver=driver,
        settings={name: parse_setting(part, problems) for name, part in sources.settings.items()},
        interfaces={
            name: parse_interface(part, name, problems) for name, part in sources.interfaces.items()
        },
        tests=[parse_test(part, problems) for part in sources.tests],
        simulated=(
            parse_simulator(sources, driver, catalog, problems)
            if sources.simulator or sources.rules
            else SimulatorSpec()
        ),
        tags=parse_tags(sources.root, problems) if sources.kind == "robot" else (),
    )
    if has_errors(problems):
        return None
    return _link(sources, parsed, registry, problems)


def _link(
    sources: Sources, parsed: _Parsed, registry: WidgetFolder, problems: Problems
) -> Profile | None:
    driver = parsed.driver
    uses = link_driver(sources.driver, driver, parsed.settings, problems)
    simulated = parsed.simulated
    emulated, world = link_simulator(sources, driver, simulated, parsed.settings, problems)
    tests = [
        link_test(part, test, driver, parsed.settings, problems)
        for part, test in zip(sources.tests, parsed.tests, strict=True)
    ]
    slots = link_slots(sources, driver, registry, problems)
    interfaces = {
        name: link_interface(sources.interfaces[name], interface, slots, driver, registry, problems)
        for name, interface in parsed.interfaces.items()
    }
    if has_errors(problems) or has_errors(registry.problems):
        return None
    check_profile(sources, driver, interfaces, uses, problems)
    root = sources.root
    name = root.text("name")
    title = root.text("title", spoken_name(name))
    if not interfaces:
        slots = slots or automatic_slots(driver, registry)
        interfaces = {"default": default_interface(slots, title)}
    used = {use.widget for use in slots.values()}
    used |= {use.widget for one in interfaces.values() for use in one.widgets.values()}
    widgets = {one: registry.get(one) for one in sorted(used)}
    return Profile(
        name=name,
        title=title,
        file=root.document.file,
        summary=root.text("summary"),
        settings=parsed.settings,
        driver=driver,
        slots=slots,
        interfaces=interfaces,
        widgets={one: widget for one, widget in widgets.items() if widget is not None},
        tests=tuple(tests),
        simulator=tuple(rule for rules in simulated.rules.values() for rule in rules),
        emulated=emulated,
        world=world,
        licence=root.text("licence"),
        author=root.text("author"),
        tags=parsed.tags,
        picture=find_picture(root.document.file),
    )

"""The last pass: rules that check a complete profile and only warn."""

import re
from pathlib import PurePath
from typing import Final

from urc.config.link.driver import NameUses
from urc.config.node import Node, Problems, shown_duration
from urc.config.rules.flow import check_flow
from urc.config.sources import Sources
from urc.config.spelling_suggestions import did_you_mean
from urc.model.driver import Driver, Poll, Timeouts
from urc.model.interface import Interface

__all__ = ["check_profile"]

_ENDINGS: Final = (".yaml", ".yml")
"""File suffixes of documents; a document that was not read from a file has none of them."""


def check_profile(
    sources: Sources,
    driver: Driver,
    interfaces: dict[str, Interface],
    uses: NameUses,
    problems: Problems,
) -> None:
    """Warn about unused declarations, inconsistent names, unfilled slots and fast polls."""
    _check_name(sources, problems)
    _check_unused(sources, driver, uses, problems)
    _check_slots(sources, interfaces, problems)
    _check_unfilled(sources, interfaces, problems)
    for part, poll in zip(sources.driver.listed("polls"), driver.polls, strict=True):
        _check_pace(part, poll, sources.driver, problems)
    _check_rate(sources.driver, driver, problems)
    secrets = {name for name, one in sources.settings.items() if one.flag("secret", default=False)}
    check_flow(sources.driver, driver, frozenset(secrets), problems)


def _check_name(sources: Sources, problems: Problems) -> None:
    """Warn about a robot whose name differs from its file name."""
    file = PurePath(sources.root.document.file)
    name = sources.root.text("name")
    # In a package, the folder has the robot's name, and the file is always `robot.yaml`.
    is_of_package = file.name == "robot.yaml" and file.parent.name == name
    is_other = file.suffix in _ENDINGS and name != file.stem and not is_of_package
    if sources.kind == "robot" and is_other:
        problems.warn(
            sources.root,
            "name-mismatch",
            f"the robot has the name {name!r}, but its file has the name {file.name!r}",
            at="name",
            hint=f"write name: {file.stem}, or rename the file to {name}{file.suffix}",
        )


def _check_unused(sources: Sources, driver: Driver, uses: NameUses, problems: Problems) -> None:
    for name, part in sources.driver.named("signals").items():
        if name not in uses.signals and driver.signals[name].formula is None:
            problems.warn(
                part,
                "never-set",
                f"nothing sets the signal {name!r}",
                key=True,
                hint=f"set the signal with (?P<{name}>…) in a 'regex', {{{name}}} in a 'pattern',"
                f" 'u16be {name}' in a 'struct', or a formula under 'value'",
            )
    for name, part in sources.driver.named("transports").items():
        if name not in uses.transports:
            problems.warn(
                part, "unused-transport", f"nothing uses the transport {name!r}", key=True
            )
    for name, part in sources.settings.items():
        if name not in uses.settings:
            problems.warn(
                part,
                "unused-setting",
                f"nothing uses the setting {name!r}",
                key=True,
                hint=f"write {{{{ settings.{name} }}}} in place of the value",
            )


def _check_slots(sources: Sources, interfaces: dict[str, Interface], problems: Problems) -> None:
    """Warn about a slot that the robot's document fills but no interface shows.

    A driver's document may fill slots for other interfaces, so the driver's slots are not checked.
    """
    if not sources.interfaces:
        return
    shown = {name for interface in interfaces.values() for name in interface.shown}
    for name, parts in sources.slots.items():
        part = parts[-1]
        if name not in shown and part.document is sources.root.document:
            problems.warn(
                part,
                "slot-not-shown",
                f"no interface has a slot {name!r}",
                key=True,
                hint=did_you_mean(name, shown, "slots"),
            )


def _check_unfilled(sources: Sources, interfaces: dict[str, Interface], problems: Problems) -> None:
    """Warn about a slot without a widget in a grid of the robot's own document.

    Interfaces in separate documents are not checked, because they may serve several drivers with
    different slots.
    """
    for name, interface in interfaces.items():
        part = sources.interfaces[name]
        filled = {*sources.slots, *interface.widgets}
        free = filled - {*interface.shown}
        empty = {*interface.shown} - filled - {interface.background}
        for slot in sorted(empty) if part.path else ():
            found = _drawn(part, slot)
            if found is not None:
                picture, offset = found
                problems.warn(
                    picture,
                    "slot-not-filled",
                    f"no widget fills the slot {slot!r}",
                    offset=offset,
                    length=len(slot),
                    hint=did_you_mean(slot, free, "slots that are not shown")
                    if free
                    else f"write widgets: {{ {slot}: {{ use: … }} }}, or '.' instead of its name",
                )


def _drawn(part: Node, slot: str) -> tuple[Node, int] | None:
    """Return the first grid that shows a slot, and the slot's offset in the grid's text."""
    for page in (part, *part.named("tabs").values()):
        one = page.get("grid")
        several = [*page.named("layouts").values(), *page.named("left_handed").values()]
        for picture in (*([one] if one is not None else []), *several):
            found = re.search(rf"(?<!\S){re.escape(slot)}(?!\S)", picture.data)
            if found is not None:
                return picture, found.start()
    return None


def _check_pace(part: Node, poll: Poll, driver: Node, problems: Problems) -> None:
    """Warn about a poll whose reply timeout is longer than its period.

    A declared timeout at or below the default causes no warning.
    """
    if poll.reply is None:
        return
    asked = driver.must("commands").must(poll.run) if poll.run else part
    reply = asked.get("reply")
    where: Node | None = reply.get("timeout") if reply else None
    seconds = poll.reply.timeout_s
    if where is None:
        timeouts = driver.must("transports").must(poll.transport).get("timeouts")
        where = timeouts.get("reply") if timeouts else None
        if where is None:
            return  # the author did not choose the default
        seconds = Problems().duration(timeouts, "reply", 2.0) if timeouts else None
    if seconds is not None and seconds > max(poll.every_s, Timeouts().reply_s):
        problems.warn(
            part.must("every"),
            "short-poll-timeout",
            f"the next request is due after {shown_duration(poll.every_s)}, but a reply may take"
            f" {shown_duration(seconds)}",
            hint=f"shorten the timeout in {_place(where, part)}, or poll less often",
        )


def _place(part: Node, near: Node) -> str:
    """Return the line number of `part` as text, with the file name if `near` is in another file."""
    mark = part.document.at(part.path)
    file = part.document.source_of(part.path).file
    line = f"line {mark.span.line if mark else 1}"
    return line if file == near.document.source_of(near.path).file else f"{line} of {file}"


def _check_rate(part: Node, driver: Driver, problems: Problems) -> None:
    """Warn about polls that together exceed the request rate of their transport."""
    for name, transport in driver.transports.items():
        if not transport.min_gap_s:
            continue
        rate = sum(1 / poll.every_s for poll in driver.polls if poll.transport == name)
        if rate * transport.min_gap_s > 1:
            problems.warn(
                part.must("transports").must(name),
                "too-many-polls",
                f"the polls need {rate:g} requests a second, but a min_gap of"
                f" {shown_duration(transport.min_gap_s)} allows only {1 / transport.min_gap_s:g}",
                at="min_gap",
            )

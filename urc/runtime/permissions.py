"""What a package may do, derived from its documents: they are data, and nothing else runs here."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from urc._phrases import joined, phrase
from urc.config.load import Checked, check
from urc.expressions import Template
from urc.model.driver import TransportSpec
from urc.model.profile import Profile
from urc.problems import ProblemsError, UrcError
from urc.runtime.catalog import built_in_catalog
from urc.runtime.near import check_hosts
from urc.runtime.shelves import shelf_of
from urc.shipped import shipped

__all__ = ["permissions"]


def permissions(document: Path, folder: Path, widgets: Sequence[str]) -> list[str]:
    """Return what a package may do, one line each.

    Args:
        document: the package's own.
        folder: with all that the package needs; nothing outside may be named.
        widgets: names of the widgets that come along.

    Raises:
        ProblemsError: the document is broken.
        UrcError: it refers to a file outside.
    """
    checked = check(document, built_in_catalog(), shelf_of(document))
    _check_inside(checked, folder)  # first: a finding would show a line of the file outside
    errors = [problem for problem in checked.problems if problem.severity == "error"]
    if errors:
        raise ProblemsError(errors)
    if checked.profile:
        check_hosts(checked.profile)
    lines = _of_profile(checked.profile) if checked.profile else []
    return [
        *lines,
        *(phrase("has the browser show the page {url}", url=url) for url in checked.pages),
        *(
            phrase(
                "widget {name}: a program in a frame of its own; it sees and gives what its cell is"
                " bound to, and nothing else",
                name=name,
            )
            for name in widgets
        ),
    ] or [phrase("nothing: it is a layout, with no connection of its own")]


def _check_inside(checked: Checked, folder: Path) -> None:
    homes = (folder.resolve(), shipped("widgets").resolve())
    for file in checked.files:
        real = Path(file).resolve()
        if not any(real.is_relative_to(home) for home in homes):
            raise UrcError(f"{checked.files[0]}: it refers to {file}, which is not in the package")


def _of_profile(profile: Profile) -> list[str]:
    lines: list[str] = [_of_transport(spec, profile) for spec in profile.driver.transports.values()]
    for setting in profile.settings.values():
        if setting.type == "path":
            lines.append(phrase("file: the one that the setting {name} names", name=setting.name))
        if setting.is_secret:
            lines.append(
                phrase("secret: is given what the setting {name} holds", name=setting.name)
            )
    commands = profile.driver.commands
    moving = sorted(name for name, command in commands.items() if command.hold or command.moves)
    if commands:
        lines.append(phrase("commands: {names}", names=", ".join(sorted(commands))))
    if moving:
        lines.append(phrase("moves the robot: {names}", names=", ".join(moving)))
    return lines


def _of_transport(spec: TransportSpec, profile: Profile) -> str:
    """Return the line of a connection: its type, and where each of its options comes from."""
    options = [
        joined(" ", (name, _told(value, profile))) for name, value in sorted(spec.options.items())
    ]
    names = {
        "type": spec.type,
        "name": spec.name,
        "options": joined(", ", options) if options else phrase("no options"),
    }
    if spec.via:
        return phrase("connects by {type} ({name}) through {via}: {options}", via=spec.via, **names)
    return phrase("connects by {type} ({name}): {options}", **names)


def _told(value: Any, profile: Profile) -> str:
    """Return an option as it is written; of a setting also what it is without an answer."""
    if isinstance(value, Template):
        text = value.source
        used = [
            phrase("{name} is {value} by default", name=name, value=setting.default)
            for name, setting in profile.settings.items()
            if name in value.settings and setting.default is not None and not setting.is_secret
        ]
        if not used:
            return phrase("from the settings: {text}", text=text)
        return phrase("from the settings: {text} ({used})", text=text, used=joined(", ", used))
    if isinstance(value, (list, tuple)):
        return joined(", ", [_told(one, profile) for one in value]) or phrase("none")
    if isinstance(value, dict):
        some = [joined(" ", (str(name), _told(one, profile))) for name, one in value.items()]
        return joined(", ", some) or phrase("none")
    return phrase("always {value}", value=value)

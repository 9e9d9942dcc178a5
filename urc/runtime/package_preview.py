"""A preview of a package's permissions and risks, shown before an installation or update.

Files, keys, agents, remote programs and hosts normally come from settings. A package may name them
as constants, but the person who installs the package must be informed. The preview therefore lists
constants separately from the permissions.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from urc._translatable import joined, phrase
from urc.config.load import CheckResult, check
from urc.config.resolve import resolve
from urc.expressions import Template
from urc.model.driver import TransportSpec
from urc.model.profile import Profile
from urc.problems import ProblemsError, UrcError
from urc.runtime.local_hosts import check_hosts, urls_of
from urc.runtime.registries import built_in_catalog
from urc.runtime.widget_registry import widget_folder_of
from urc.shipped import shipped
from urc.source import parse_document

__all__ = ["PackagePreview", "look", "permissions", "risks_of"]


def permissions(document: Path, folder: Path, widgets: Sequence[str]) -> list[str]:
    """Return a package's permissions, one per line.

    Args:
        document: the document of the package.
        folder: folder with all files of the package; references to files outside it are errors.
        widgets: names of the widgets in the package.

    Raises:
        ProblemsError: the document has errors.
        UrcError: the document refers to a file outside the folder, or has this machine as a fixed
            host.
    """
    checked = check(document, built_in_catalog(), widget_folder_of(document))
    _check_inside(checked, folder)  # first, because a problem would show a line in an outside file
    errors = [problem for problem in checked.problems if problem.severity == "error"]
    if errors:
        raise ProblemsError(errors)
    if checked.profile:
        check_hosts(checked.profile)
    lines = _of_profile(checked.profile) if checked.profile else []
    return [
        *lines,
        *(phrase("makes the browser show the page {url}", url=url) for url in checked.pages),
        *(
            phrase(
                "widget {name}: a program in a separate frame; it can read and send only what its"
                " slot is bound to",
                name=name,
            )
            for name in widgets
        ),
    ] or [phrase("nothing: the package is only a layout, without connections")]


def _check_inside(checked: CheckResult, folder: Path) -> None:
    homes = (folder.resolve(), shipped("widgets").resolve())
    for file in checked.files:
        real = Path(file).resolve()
        if not any(real.is_relative_to(home) for home in homes):
            raise UrcError(
                f"{checked.files[0]}: the document refers to {file}, which is not in the package"
            )


def _of_profile(profile: Profile) -> list[str]:
    lines: list[str] = [_of_transport(spec, profile) for spec in profile.driver.transports.values()]
    for setting in profile.settings.values():
        if setting.type == "path":
            lines.append(phrase("file: the path in the setting {name}", name=setting.name))
        if setting.is_secret:
            lines.append(
                phrase("secret: receives the value of the setting {name}", name=setting.name)
            )
    commands = profile.driver.commands
    moving = sorted(name for name, command in commands.items() if command.hold or command.moves)
    if commands:
        lines.append(phrase("commands: {names}", names=", ".join(sorted(commands))))
    if moving:
        lines.append(phrase("moves the robot: {names}", names=", ".join(moving)))
    return lines


def _of_transport(spec: TransportSpec, profile: Profile) -> str:
    """Return a description of a connection: its type, and the source of each option."""
    options = [
        joined(" ", (name, _told(value, profile))) for name, value in sorted(spec.options.items())
    ]
    names = {
        "type": spec.type,
        "name": spec.name,
        "options": joined(", ", options) if options else phrase("no options"),
    }
    if spec.tunnel:
        return phrase(
            "connects by {type} ({name}) through {via}: {options}", via=spec.tunnel, **names
        )
    return phrase("connects by {type} ({name}): {options}", **names)


def _told(value: Any, profile: Profile) -> str:
    """Return an option as the document contains it, followed by the defaults of its settings."""
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


_FILES: Final = {
    "key": phrase("a key file"),
    "known_hosts": phrase("a known-hosts file"),
    "ca": phrase("a file of certificates"),
    "cert": phrase("a certificate file"),
}
_LOOPBACK: Final = re.compile(r"(localhost|127\.[0-9.]+|::1)$")
_DEVICE: Final = re.compile(r"/dev/[A-Za-z0-9._:/-]+|COM[0-9]{1,3}|[a-z]+://.*", re.IGNORECASE)
_URL_HOST: Final = re.compile(r"[a-z+]+://(?:[^/@]*@)?(?P<host>\[[^\]]*\]|[^/:?#]*)", re.IGNORECASE)


def risks_of(profile: Profile) -> list[str]:
    """Return the hard-coded files, keys, programs and hosts in a package, one per line."""
    found = [
        line
        for spec in profile.driver.transports.values()
        for line in _risks_of_transport(spec, profile)
    ]
    return list(dict.fromkeys(found))


def _risks_of_transport(spec: TransportSpec, profile: Profile) -> Iterator[str]:
    options = spec.options
    tls = options.get("tls")
    named = {**(tls if isinstance(tls, Mapping) else {}), **options}
    for name, what in _FILES.items():
        if name in named and (text := _own(named[name], profile)):
            yield phrase(
                "{line} uses {what} of this machine: {text}", line=spec.name, what=what, text=text
            )
    port = _own(options.get("port"), profile) if spec.type == "serial" else ""
    if port and (not _DEVICE.fullmatch(port) or ".." in port):
        yield phrase(
            "{line} opens a file that is not a serial port: {text}", line=spec.name, text=port
        )
    if options.get("agent") and _own(options["agent"], profile):
        yield phrase("{line} logs in with the keys of your SSH agent", line=spec.name)
    if text := _own(options.get("command"), profile):
        yield phrase(
            "{line} runs a program on the machine it logs in to: {text}", line=spec.name, text=text
        )
    for host in _fixed_hosts(options):
        is_beyond = bool(spec.tunnel) and _LOOPBACK.match(host) is not None
        if not is_beyond:
            yield phrase("{line} connects to a fixed host: {host}", line=spec.name, host=host)


def _own(value: Any, profile: Profile) -> str:
    """Return the text of an option with its defaults; "" if it depends only on settings."""
    if value is None or value is False:
        return ""
    if not isinstance(value, Template):
        return str(value)
    defaults = [
        setting
        for name in sorted(value.settings)
        if (setting := profile.settings.get(name)) is not None and setting.default is not None
    ]
    if value.settings and not any(one.default not in ("", False) for one in defaults):
        return ""
    said = ", ".join(f"{one.name}: {one.default}" for one in defaults)
    return f"{value.source} ({said})" if said else value.source


def _fixed_hosts(options: Mapping[str, object]) -> list[str]:
    """Return the fixed hosts of a transport, without those that depend on settings."""
    host = options.get("host")
    text = host.source if isinstance(host, Template) and not host.settings else host
    if isinstance(text, str):
        return [text]
    sources = (url.source if isinstance(url, Template) else url for url in urls_of(options))
    matches = (_URL_HOST.match(source) for source in sources if isinstance(source, str))
    hosts = (found["host"] for found in matches if found)
    return [one for one in dict.fromkeys(hosts) if "{{" not in one]


_NOT_WIRE: Final = (
    *("urc", "kind", "name", "title", "summary", "licence", "author"),
    *("widgets", "interfaces", "tests", "simulator"),
)


class PackagePreview(NamedTuple):
    """The preview of a package."""

    permissions: list[str]
    """Permissions of the package, each as one line of text."""
    wire: Mapping[str, str]
    """Values of all keys that affect sent bytes, the decoding of replies, or the operators' rights.
    The values are stored by key path, such as ``commands.beep.send``."""
    risks: list[str]
    """Hard-coded files, keys, programs and hosts; see `risks_of`."""


def look(document: Path, folder: Path, widgets: Sequence[str]) -> PackagePreview:
    """Return the preview of a package.

    Args:
        document: the document of the package.
        folder: folder with all files of the package; references to files outside it are errors.
        widgets: names of the widgets in the package.

    Raises:
        ProblemsError: the document has errors.
        UrcError: the document refers to a file outside the folder, or has this machine as a fixed
            host.
    """
    allowed = permissions(document, folder, widgets)
    registry = widget_folder_of(document)
    checked = check(document, built_in_catalog(), registry)
    if checked.profile is None:
        return PackagePreview(allowed, {}, [])
    risks = risks_of(checked.profile)
    text = resolve(str(document), registry, checked.profile).text
    data = parse_document(text.encode(), "resolved").data
    assert isinstance(data, dict)  # noqa: S101 (a loaded document is a mapping)
    wire = {key: value for key, value in data.items() if key not in _NOT_WIRE}
    return PackagePreview(allowed, dict(_flat(wire, "")), risks)


def _flat(value: object, path: str) -> Iterator[tuple[str, str]]:
    """Yield the path and the text of every leaf value in a document."""
    if isinstance(value, dict) and value:
        for key, inner in value.items():
            yield from _flat(inner, f"{path}.{key}" if path else str(key))
    elif isinstance(value, list) and value:
        for place, inner in enumerate(value):
            yield from _flat(inner, f"{path}.{place}")
    else:
        yield path, f'"{value}"' if isinstance(value, str) else str(value)

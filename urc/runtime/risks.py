"""What of this machine, and where, a package uses by itself, without anybody having filled it in.

Files, keys, agents, commands on other machines and hosts come from settings. A package may name
them itself, but the person who installs it must know: they are told apart from what it may do.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any, Final

from urc._phrases import phrase
from urc.expressions import Template
from urc.model.driver import TransportSpec
from urc.model.profile import Profile

__all__ = ["risks_of"]

_FILES: Final = {
    "key": phrase("a key file"),
    "known_hosts": phrase("a file of known hosts"),
    "ca": phrase("a file of certificates"),
    "cert": phrase("a certificate file"),
}
_LOOPBACK: Final = re.compile(r"(localhost|127\.[0-9.]+|::1)$")
_DEVICE: Final = re.compile(r"/dev/[A-Za-z0-9._:/-]+|COM[0-9]{1,3}|[a-z]+://.*", re.IGNORECASE)
_URL_HOST: Final = re.compile(r"[a-z+]+://(?:[^/@]*@)?(?P<host>\[[^\]]*\]|[^/:?#]*)", re.IGNORECASE)


def risks_of(profile: Profile) -> list[str]:
    """Return what a package names by itself, one line each; empty for most."""
    found = [
        line for spec in profile.driver.transports.values() for line in _of_transport(spec, profile)
    ]
    return list(dict.fromkeys(found))


def _of_transport(spec: TransportSpec, profile: Profile) -> Iterator[str]:
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
            "{line} opens a file that is no serial port: {text}", line=spec.name, text=port
        )
    if options.get("agent") and _own(options["agent"], profile):
        yield phrase("{line} logs in with the keys of your SSH agent", line=spec.name)
    if text := _own(options.get("command"), profile):
        yield phrase(
            "{line} runs a program on the machine it logs in to: {text}", line=spec.name, text=text
        )
    if host := _fixed_host(options):
        is_beyond = bool(spec.via) and _LOOPBACK.match(host) is not None
        if not is_beyond:
            yield phrase("{line} connects to a fixed host: {host}", line=spec.name, host=host)


def _own(value: Any, profile: Profile) -> str:
    """Return what a package says by itself; "" where all of it is filled in by a person."""
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


def _fixed_host(options: Mapping[str, object]) -> str:
    """Return the host that no setting decides, or ""."""
    host, url = options.get("host"), options.get("url")
    text = host.source if isinstance(host, Template) and not host.settings else host
    if isinstance(text, str):
        return text
    source = url.source if isinstance(url, Template) else url
    if not isinstance(source, str):
        return ""
    found = _URL_HOST.match(source)
    return found["host"] if found and "{{" not in found["host"] else ""

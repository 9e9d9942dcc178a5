"""Detect hosts that are this machine or have a link-local address.

If a package named a fixed local host, it could connect to programs on the computer of the person
who installs it. A package may therefore address this machine only through a setting.
"""

import ipaddress
import re
import socket
from collections.abc import Mapping
from typing import Final

from urc._addresses import unmapped
from urc.expressions import Template
from urc.model.driver import TransportSpec
from urc.model.profile import Profile
from urc.problems import UrcError

__all__ = ["check_hosts", "is_near", "urls_of"]

_LOCAL: Final = re.compile(r"(.*\.)?localhost(\.localdomain)?\.?|ip6-(localhost|loopback)", re.I)
_BEGINS: Final = re.compile(r"127\.|169\.254\.|\[?(::1|fe[89ab][0-9a-f]:)|localhost", re.I)
"""Pattern of a fixed beginning that makes a host local, regardless of the setting after it."""
_URL: Final = re.compile(r"[a-z]+://(?P<host>\[[^\]]*\]|[^/:?#]*)", re.I)
_DEVICE: Final = "v4l2:"


def is_near(host: str) -> bool:
    """Return whether `host`, in any notation, is this machine or a link-local address."""
    text = host.strip().removeprefix("[").removesuffix("]").partition("%")[0]
    if _LOCAL.fullmatch(text):
        return True
    try:
        address = unmapped(ipaddress.ip_address(text))
    except ValueError:
        try:  # "127.1", "0x7f.1" and "2130706433" are addresses too
            address = ipaddress.ip_address(socket.inet_aton(text))
        except (OSError, ValueError):
            return False
    return address.is_loopback or address.is_link_local or address.is_unspecified


def urls_of(options: Mapping[str, object]) -> list[object]:
    """Return the URLs of a transport, as text or templates; a camera may have two streams."""
    streams = options.get("streams")
    more = streams.values() if isinstance(streams, Mapping) else ()
    return [one for one in (options.get("url"), *more) if one is not None]


def _text(value: object) -> str:
    source = value.source if isinstance(value, Template) else value
    return source if isinstance(source, str) else ""


def check_hosts(profile: Profile) -> None:
    """Raise `UrcError` if a package's document names this machine as a fixed host."""
    for spec in profile.driver.transports.values():
        if spec.tunnel or spec.options.get("mode") == "listen":
            continue  # resolved on another machine, or the robot connects to URC
        host = "" if _is_listener(spec) else _fixed(spec.options)
        if host:
            raise UrcError(
                f"{profile.file}: the transport {spec.name} has the fixed host {host}, which is"
                " this machine: a package may use this machine only through a setting"
            )


def _is_listener(spec: TransportSpec) -> bool:
    """Return whether the URL is an address of this machine at which a camera's data arrives."""
    texts = [_text(url) for url in urls_of(spec.options)]
    return spec.is_camera and all(one.lower().startswith("udp://") for one in texts)


def _fixed(options: Mapping[str, object]) -> str:
    """Return a local host that does not depend on a setting, or ""."""
    hosts = [_text(options.get("host"))]
    for text in map(_text, urls_of(options)):
        if text.lower().startswith(_DEVICE) and "{{" not in text:
            return text  # a camera of the person who installs the package
        found = _URL.match(text)
        hosts.append(found["host"] if found else text)
    for host in hosts:
        if "{{" in host:
            if not host.startswith("{{") and _BEGINS.match(host):
                return host
        elif is_near(host):
            return host
    return ""

"""Discovers ONVIF cameras with WS-Discovery.

Each network interface sends a probe to the multicast group, and cameras reply with the addresses of
their device service. Sources: WS-Discovery (April 2005), sections 4 and 5, and ONVIF Core
Specification, section 7.
"""

import asyncio
import re
import socket
import struct
import uuid
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree

__all__ = ["CameraAnnouncement", "cameras", "matches"]

GROUP: Final = ("239.255.255.250", 3702)
"""Multicast group and port of WS-Discovery."""
MAX_CAMERAS: Final = 256
_REPEAT_S: Final = 0.2
"""Time between the two copies of a probe, in seconds; datagrams may be lost."""
_PROBE: Final = """\
<?xml version="1.0" encoding="utf-8"?>
<s:Envelope xmlns:s="http://www.w3.org/2003/05/soap-envelope"\
 xmlns:a="http://schemas.xmlsoap.org/ws/2004/08/addressing"\
 xmlns:d="http://schemas.xmlsoap.org/ws/2005/04/discovery"\
 xmlns:dn="http://www.onvif.org/ver10/network/wsdl"><s:Header>\
<a:MessageID>{message}</a:MessageID>\
<a:To>urn:schemas-xmlsoap-org:ws:2005:04:discovery</a:To>\
<a:Action>http://schemas.xmlsoap.org/ws/2005/04/discovery/Probe</a:Action></s:Header>\
<s:Body><d:Probe><d:Types>dn:NetworkVideoTransmitter</d:Types></d:Probe></s:Body></s:Envelope>"""
_ADDRESSING: Final = "{http://schemas.xmlsoap.org/ws/2004/08/addressing}"
_DISCOVERY: Final = "{http://schemas.xmlsoap.org/ws/2005/04/discovery}"
_SCOPE: Final = re.compile(r"onvif://www[.]onvif[.]org/(name|hardware)/([^/\s]+)", re.I)


class CameraAnnouncement(NamedTuple):
    """One camera that replied to the probe."""

    host: str
    port: int
    path: str
    """Path of the device service, such as ``/onvif/device_service``."""
    name: str
    """Name and hardware as the camera states them; may be empty."""


async def cameras(seconds: float) -> list[CameraAnnouncement]:
    """Return the cameras that reply within `seconds`, sorted by address.

    Raises:
        OSError: no network is available.
    """
    message = f"urn:uuid:{uuid.uuid4()}"
    probe = _PROBE.format(message=message).encode()
    found: dict[CameraAnnouncement, None] = {}

    def take(data: bytes) -> None:
        for camera in matches(data, message):
            if len(found) < MAX_CAMERAS:
                found[camera] = None

    loop = asyncio.get_running_loop()
    links: list[asyncio.DatagramTransport] = []
    try:
        for sender in filter(None, (_sender(index) for index, _ in socket.if_nameindex())):
            link, _ = await loop.create_datagram_endpoint(lambda: _Receiver(take), sock=sender)
            links.append(link)
        if not links:
            raise OSError("no network interface sends multicast")
        for wait_s in (min(_REPEAT_S, seconds), max(seconds - _REPEAT_S, 0.0)):
            for link in links:
                link.sendto(probe, GROUP)
            await asyncio.sleep(wait_s)
    finally:
        for link in links:
            link.abort()
    return sorted(found)


def matches(data: bytes, message: str) -> Iterator[CameraAnnouncement]:
    """Yield the cameras in a reply to the probe with the ID `message`; yield none if it is invalid.

    A document type declaration makes a reply invalid, so that no entity expands.
    """
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        return
    try:
        root = ElementTree.fromstring(data)  # noqa: S314 - without a document type, nothing expands
    except (ElementTree.ParseError, ValueError, LookupError):
        return
    if (root.findtext(f".//{_ADDRESSING}RelatesTo") or "").strip() != message:
        return
    for match in root.iter(f"{_DISCOVERY}ProbeMatch"):
        scopes = match.findtext(f"{_DISCOVERY}Scopes") or ""
        words = dict.fromkeys(unquote(text) for _, text in _SCOPE.findall(scopes))
        for address in (match.findtext(f"{_DISCOVERY}XAddrs") or "").split()[:4]:
            place = _place(address)
            if place is not None:
                yield CameraAnnouncement(*place, " ".join(words))


def _place(address: str) -> tuple[str, int, str] | None:
    """Return the host, port and path of an ``http`` address; None for any other address."""
    try:
        parts = urlsplit(address)
        port = parts.port
    except ValueError:
        return None
    if parts.scheme not in ("http", "https") or not parts.hostname:
        return None
    return parts.hostname, port or (443 if parts.scheme == "https" else 80), parts.path


def _sender(interface: int) -> socket.socket | None:
    """Return a socket that sends multicast on the interface with this index; None if it cannot."""
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sender.setblocking(False)
    try:
        chosen = struct.pack("@4s4si", bytes(4), bytes(4), interface)  # struct ip_mreqn
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, chosen)
        sender.bind(("", 0))
    except OSError:
        sender.close()
        return None
    return sender


class _Receiver(asyncio.DatagramProtocol):
    """Passes the replies on; an interface without a network is ignored."""

    def __init__(self, take: Callable[[bytes], None]) -> None:
        self._take = take

    def datagram_received(self, data: bytes, addr: object) -> None:
        """Pass a reply on."""
        self._take(data)

    def error_received(self, exc: Exception) -> None:
        """Ignore an interface on which the probe could not be sent."""

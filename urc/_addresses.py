"""Addresses of this machine's network interfaces, determined without sending a packet.

Name servers and the host name are unreliable: on many machines, the host name resolves only to
127.0.1.1. On Linux, macOS and the BSDs, getifaddrs in the C library returns the addresses. On
systems without getifaddrs, the routing table determines the source address of an outgoing packet.
"""

import ctypes
import ipaddress
import socket
import sys
from collections.abc import Iterator
from contextlib import suppress

__all__ = ["Address", "is_of_this_machine", "local_addresses", "unmapped"]

Address = ipaddress.IPv4Address | ipaddress.IPv6Address

_IS_UP = 0x1
# Documentation and private addresses; they receive no packets.
_ROUTED_TO = ("192.0.2.1", "10.255.255.254", "172.31.255.254", "192.168.255.254", "2001:db8::1")


class _Interface(ctypes.Structure):
    """Leading fields of the C type ``struct ifaddrs``; the other fields differ between systems."""

    _fields_ = (
        ("next", ctypes.c_void_p),
        ("name", ctypes.c_char_p),
        ("flags", ctypes.c_uint),
        ("address", ctypes.c_void_p),
    )


def local_addresses() -> tuple[Address, ...]:
    """Return the addresses at which other machines can reach this machine, IPv4 first.

    Loopback and link-local IPv6 addresses are excluded, because browsers on other machines cannot
    open them.
    """
    found = _all()
    usable = [each for each in found if not each.is_loopback and not each.is_unspecified]
    told = [each for each in usable if each.version == 4 or not each.is_link_local]
    return tuple(sorted(told, key=lambda each: (each.version, each.is_link_local, int(each))))


def is_of_this_machine(address: Address) -> bool:
    """Return whether `address` belongs to an interface of this machine.

    The result is False for the address of a router or container host that forwards packets to this
    machine.
    """
    plain = unmapped(address)
    return plain.is_loopback or plain.is_unspecified or plain in _all()


def unmapped(address: Address) -> Address:
    """Return `address` without its scope ID; convert an IPv4-mapped IPv6 address to IPv4."""
    if address.version == 4:
        return address
    return address.ipv4_mapped or ipaddress.IPv6Address(int(address))


def _all() -> set[Address]:
    try:
        return set(_of_interfaces())
    except (OSError, AttributeError, TypeError):  # a system without getifaddrs
        return set(_of_routes())


def _of_interfaces() -> Iterator[Address]:
    library = ctypes.CDLL(None, use_errno=True)
    first = ctypes.c_void_p()
    if library.getifaddrs(ctypes.byref(first)) != 0:
        raise OSError(ctypes.get_errno(), "getifaddrs failed")
    place: int | None = first.value
    try:
        while place:
            interface = _Interface.from_address(place)
            if interface.address and interface.flags & _IS_UP:
                yield from _decoded(interface.address)
            place = interface.next
    finally:
        library.freeifaddrs(first)


def _decoded(place: int) -> Iterator[Address]:
    """Yield the IPv4 or IPv6 address in the ``struct sockaddr`` at `place`, if present."""
    head = ctypes.string_at(place, 2)
    # BSD systems, including macOS, store a length before the family.
    is_bsd = sys.platform == "darwin" or "bsd" in sys.platform
    family = head[1] if is_bsd else int.from_bytes(head, sys.byteorder)
    if family == socket.AF_INET:
        yield ipaddress.IPv4Address(ctypes.string_at(place + 4, 4))
    elif family == socket.AF_INET6:
        yield ipaddress.IPv6Address(ctypes.string_at(place + 8, 16))


def _of_routes() -> Iterator[Address]:
    """Yield the source addresses of outgoing routes, from UDP sockets that send no packet."""
    for target in _ROUTED_TO:
        family = socket.AF_INET6 if ":" in target else socket.AF_INET
        with suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as asker:
            asker.connect((target, 9))
            yield ipaddress.ip_address(asker.getsockname()[0].partition("%")[0])

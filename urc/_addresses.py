"""The addresses of this machine's network interfaces, asked of the system: no packet is sent.

A name server or a host's own name would not do: many machines know themselves only as
127.0.1.1. The C library's getifaddrs is there on Linux, macOS and the BSDs. Where it isn't, the
routing table is asked which address it would send from.
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
# Addresses of documentation and of the private networks: nobody is asked anything there.
_ROUTED_TO = ("192.0.2.1", "10.255.255.254", "172.31.255.254", "192.168.255.254", "2001:db8::1")


class _Interface(ctypes.Structure):
    """The head of C's ``struct ifaddrs``; what follows differs from system to system."""

    _fields_ = (
        ("next", ctypes.c_void_p),
        ("name", ctypes.c_char_p),
        ("flags", ctypes.c_uint),
        ("address", ctypes.c_void_p),
    )


def local_addresses() -> tuple[Address, ...]:
    """Return the addresses under which others may reach this machine, IPv4 first.

    Loopback is left out, and so is IPv6's link-local range: no browser opens those.
    """
    found = _all()
    usable = [each for each in found if not each.is_loopback and not each.is_unspecified]
    told = [each for each in usable if each.version == 4 or not each.is_link_local]
    return tuple(sorted(told, key=lambda each: (each.version, each.is_link_local, int(each))))


def is_of_this_machine(address: Address) -> bool:
    """Return whether what is sent to `address` stays on this machine, as far as it is known here.

    An address that a router or a container's host leads back to this machine is not.
    """
    plain = unmapped(address)
    return plain.is_loopback or plain.is_unspecified or plain in _all()


def unmapped(address: Address) -> Address:
    """Return the IPv4 address inside an IPv6 one that stands for it; else `address`, bare."""
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
    """Yield the address in the ``struct sockaddr`` at `place`, if it is one of the internet's."""
    head = ctypes.string_at(place, 2)
    # The BSDs, and macOS with them, have a length before the family.
    is_bsd = sys.platform == "darwin" or "bsd" in sys.platform
    family = head[1] if is_bsd else int.from_bytes(head, sys.byteorder)
    if family == socket.AF_INET:
        yield ipaddress.IPv4Address(ctypes.string_at(place + 4, 4))
    elif family == socket.AF_INET6:
        yield ipaddress.IPv6Address(ctypes.string_at(place + 8, 16))


def _of_routes() -> Iterator[Address]:
    """Yield where a datagram would be sent from; connecting such a socket sends nothing."""
    for target in _ROUTED_TO:
        family = socket.AF_INET6 if ":" in target else socket.AF_INET
        with suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as asker:
            asker.connect((target, 9))
            yield ipaddress.ip_address(asker.getsockname()[0].partition("%")[0])

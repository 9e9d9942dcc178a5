"""The dashboard's own listeners: which places lead there, in whatever form they are written."""

import ipaddress

import pytest

from urc.transports import own_listeners
from urc.transports.own_listeners import OwnAddressError, OwnListeners

HERE = frozenset(map(ipaddress.ip_address, ("192.0.2.7", "2001:db8::7", "fe80::7")))


@pytest.fixture(autouse=True)
def one_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have a machine with three interfaces."""

    def is_here(address: own_listeners.Address) -> bool:
        return address.is_loopback or address in HERE

    monkeypatch.setattr(own_listeners, "is_of_this_machine", is_here)


def leads_here(door: str, place: str, port: int = 8080, *, is_near: bool = True) -> bool:
    """Return whether a line to `place` is refused while the dashboard listens on `door`."""
    doors = OwnListeners()
    doors.learn([f"{door}#8080"])
    try:
        doors.check_place(ipaddress.ip_address(place), port, is_near=is_near)
    except OwnAddressError:
        return True
    return False


@pytest.mark.parametrize(
    ("door", "place", "leads"),
    [
        ("127.0.0.1", "127.0.0.1", True),
        ("127.0.0.1", "::ffff:127.0.0.1", True),
        ("127.0.0.1", "0.0.0.0", True),
        ("127.0.0.1", "127.0.0.2", False),
        ("127.0.0.1", "192.0.2.7", False),
        ("0.0.0.0", "127.0.0.1", True),
        ("0.0.0.0", "127.9.9.9", True),
        ("0.0.0.0", "192.0.2.7", True),
        ("0.0.0.0", "::ffff:192.0.2.7", True),
        ("0.0.0.0", "192.0.2.8", False),
        ("::", "192.0.2.7", True),
        ("::", "2001:db8::7", True),
        ("::", "fe80::7", True),
        ("::", "::1", True),
        ("192.0.2.7", "192.0.2.7", True),
        ("192.0.2.7", "127.0.0.1", False),
    ],
)
def test_every_form_of_its_address_leads_there(door: str, place: str, leads: bool) -> None:
    """On another port, it is another program."""
    assert leads_here(door, place) is leads
    assert not leads_here(door, place, 8081)


def test_from_another_machine_a_loopback_address_is_another_one() -> None:
    """But the address of this machine's network is this machine from everywhere."""
    assert not leads_here("0.0.0.0", "127.0.0.1", is_near=False)
    assert leads_here("0.0.0.0", "192.0.2.7", is_near=False)


def test_the_guard_is_told() -> None:
    """It is a process of its own, and has the sockets of robots that move."""
    known, told = OwnListeners(), OwnListeners()
    known.learn(["127.0.0.1#8080", "::#8443"])
    told.learn(known.words())
    assert told.words() == known.words()

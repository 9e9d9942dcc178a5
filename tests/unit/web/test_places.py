"""One visitor takes no place of others: what is under way, and seats at one robot."""

from contextlib import ExitStack

import pytest

from urc.testing.clock import FakeClock
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.feed.client_socket import SocketPeer
from urc.web.fleet.robots import CLIENTS_OF_KNOWN, CLIENTS_OF_UNKNOWN, Robot, RobotService
from urc.web.serve.access import Access
from urc.web.serve.connection_quota import KNOWN_PLACES, PLACES, ConnectionQuota, is_stop
from urc.web.serve.visitor import Visitor

ACCESS = Access()


def holder() -> Visitor:
    """Return another browser with the start key."""
    secret = ACCESS.admit(ACCESS.key)
    return ACCESS.visitor([(b"cookie", f"{ACCESS.cookie}={secret}".encode())])


UNKNOWN_VISITOR = ACCESS.visitor([])
HOLDER = holder()


@pytest.mark.parametrize(("visitor", "most"), [(UNKNOWN_VISITOR, PLACES), (HOLDER, KNOWN_PLACES)])
def test_one_visitor_has_a_bounded_number_of_places(visitor: Visitor, most: int) -> None:
    """Those of others are not touched, and what ends makes room."""
    places = ConnectionQuota()
    with ExitStack() as open_ones:
        for _ in range(most):
            assert open_ones.enter_context(places.taken(visitor, "192.0.2.7"))
        with places.taken(visitor, "192.0.2.7") as has_place:
            assert not has_place
        for other in (UNKNOWN_VISITOR, holder()):
            with places.taken(other, "192.0.2.8") as has_place:
                assert has_place
    with places.taken(visitor, "192.0.2.7") as has_place:
        assert has_place


def test_who_has_a_key_is_counted_by_it_and_not_by_the_address() -> None:
    """Behind one address there may be a whole lab."""
    places = ConnectionQuota()
    with ExitStack() as open_ones:
        for _ in range(PLACES):
            open_ones.enter_context(places.taken(UNKNOWN_VISITOR, "192.0.2.7"))
        with places.taken(HOLDER, "192.0.2.7") as has_place:
            assert has_place


@pytest.mark.parametrize(
    ("peer", "operators"),
    [
        (SocketPeer("192.0.2.7", "at 192.0.2.7"), CLIENTS_OF_UNKNOWN),
        (SocketPeer("", "ann", is_known=True), CLIENTS_OF_KNOWN),
    ],
)
def test_one_visitor_has_a_bounded_number_of_seats_at_a_robot(
    peer: SocketPeer, operators: int
) -> None:
    profile = dashboard_profile()
    service = RobotService(Robot(profile, {}, FakeRobot(profile).open), clock=FakeClock())
    with ExitStack() as open_ones:
        for _ in range(operators):
            assert service.has_room_for(peer)
            open_ones.enter_context(service.visit(peer.who))
        assert not service.has_room_for(peer)
        assert service.has_room_for(peer._replace(who="at 192.0.2.8", is_known=False))
    assert service.has_room_for(peer)


@pytest.mark.parametrize(
    ("method", "path", "stops"),
    [
        ("POST", "/api/v1/robots/puppet/stop", True),
        ("POST", "/api/v1/robots/my%20robot/stop", True),
        ("POST", "/api/v1/stop", True),
        ("POST", "/fleet/stop", True),
        ("GET", "/api/v1/stop", False),
        ("POST", "/api/v1/stop/more", False),
        ("GET", "/api/v1/robots/puppet/stop", False),
        ("POST", "/api/v1/robots/puppet/stop/more", False),
        ("POST", "/api/v1/robots/puppet/settings", False),
        ("POST", "/stop", False),
    ],
)
def test_only_stop_is_not_counted(method: str, path: str, stops: bool) -> None:
    assert is_stop(method, path) is stops

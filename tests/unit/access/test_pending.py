"""Keys of sign-ins that wait for their second request: single use, a time limit, bounded."""

import pytest

from urc.access.pending import MOST_PENDING, MOST_PENDING_HERE, Pending, place_of


def test_a_key_works_once() -> None:
    pending: Pending[str] = Pending(60.0)
    key = pending.begin("value", "192.0.2.1", 0.0)
    assert len(key) >= 43, "256 bits"
    assert pending.finish(key, 59.9) == "value"
    assert pending.finish(key, 59.9) is None
    assert pending.finish("guess", 59.9) is None


def test_a_late_key_is_invalid_and_forgotten() -> None:
    pending: Pending[str] = Pending(60.0)
    key = pending.begin("value", "192.0.2.1", 0.0)
    pending.begin("later", "192.0.2.1", 30.0)
    assert pending.finish(key, 60.0) is None
    assert len(pending) == 1


def test_one_place_cannot_push_out_the_keys_of_another() -> None:
    pending: Pending[int] = Pending(60.0)
    mine = pending.begin(-1, "192.0.2.1", 0.0)
    keys = [pending.begin(each, "2001:db8::" + str(each), 0.0) for each in range(500)]
    assert len(pending) == 1 + MOST_PENDING_HERE
    assert [pending.finish(key, 1.0) for key in keys[-2:]] == [498, 499]
    assert pending.finish(keys[0], 1.0) is None
    assert pending.finish(mine, 1.0) == -1


def test_all_places_together_are_bounded() -> None:
    pending: Pending[int] = Pending(60.0)
    for each in range(MOST_PENDING + 10):
        pending.begin(each, f"10.0.{each // 256}.{each % 256}", 0.0)
    assert len(pending) == MOST_PENDING


@pytest.mark.parametrize(
    ("address", "place"),
    [
        ("192.0.2.7", "192.0.2.7"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("2001:db8:1:2:3::4", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("", ""),
        ("a socket", "a socket"),
    ],
)
def test_an_ipv6_network_counts_as_one_place(address: str, place: str) -> None:
    assert place_of(address) == place

"""The revocation list: only the authority's key makes one."""

import json
from pathlib import Path

import pytest

from tests.unit.fleet.fleets import NOW, Place
from urc.fleet.names import FleetError
from urc.fleet.revocations import MAX_BYTES, RevocationList


def test_a_list_is_only_accepted_as_the_authority_signed_it(tmp_path: Path) -> None:
    place, other = Place(tmp_path / "a"), Place(tmp_path / "b")
    hall = place.member()
    place.authority.revoke("hall", NOW)
    signed = place.authority.signed_revocations()
    assert RevocationList.verified(signed, hall.root).count == 2
    changed = json.loads(signed)
    changed["content"] = changed["content"].replace('"number":1', '"number":9')
    for data, fault in (
        (json.dumps(changed).encode(), "not signed by the authority of fleet mill"),
        (other.authority.signed_revocations(), "not signed by the authority of fleet mill"),
        (signed[:-9], "the revocation list is damaged"),
        (b"", "the revocation list is damaged"),
        (b" " * (MAX_BYTES + 1), "has more than"),
    ):
        with pytest.raises(FleetError, match=fault):
            RevocationList.verified(data, hall.root)


def test_the_number_grows_with_each_new_certificate_only() -> None:
    empty = RevocationList("mill")
    first = empty.revoking("hall", frozenset({1, 2}))
    assert (first.number, first.count) == (1, 2)
    assert first.revoking("hall", frozenset({2})) is first
    second = first.revoking("store", frozenset({3}))
    assert (second.number, second.count) == (2, 3)
    assert [second.revokes(one) for one in (1, 2, 3, 4)] == [True, True, True, False]

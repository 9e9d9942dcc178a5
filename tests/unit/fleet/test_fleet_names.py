"""Names of sites and addresses: what is not one is refused with an example."""

import pytest

from urc.fleet.names import FleetError, address_of, endpoint, fleet_name, site_name


@pytest.mark.parametrize("name", ["a", "7", "north-hall", "a" * 32, "0-0"])
def test_names_are_small_letters_digits_and_dashes(name: str) -> None:
    assert (fleet_name(name), site_name(name)) == (name, name)


@pytest.mark.parametrize("name", ["", "-a", "a-", "A", "a.b", "a b", "a" * 33, "é", "a\n", None, 7])
def test_other_names_are_refused(name: object) -> None:
    with pytest.raises(FleetError, match="expected the name of a site, 1 to 32 characters"):
        site_name(name)


@pytest.mark.parametrize(
    "address", ["192.168.1.20:7447", "hall.lan:1", "[::]:7447", "[fe80::1]:65534", "0.0.0.0:7447"]
)
def test_an_address_becomes_an_endpoint_and_back(address: str) -> None:
    assert endpoint(address) == endpoint(f"tls/{address}") == f"tls/{address}"
    assert address_of(endpoint(address)) == address


@pytest.mark.parametrize(
    "address",
    ["", "hall", "hall:", ":7447", "hall:0", "hall:65535", "hall:x", "::1:7447", "[::1:7447",
     "tcp/hall:7447", "https://hall:7447", "hall :7447", "-a:1", "hall:²"],
)  # fmt: skip
def test_other_addresses_are_refused(address: str) -> None:
    with pytest.raises(FleetError, match="expected an address such as"):
        endpoint(address)

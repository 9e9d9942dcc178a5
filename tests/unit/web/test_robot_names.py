"""The name of a robot of another site contains the site."""

import pytest

from urc.web.sites.robot_names import FarName, far_name, far_query, far_target


@pytest.mark.parametrize(
    ("name", "far"),
    [
        ("cart@bern", FarName("cart", "bern")),
        ("my cart@bern", FarName("my cart", "bern")),
        ("a@b@bern", FarName("a@b", "bern")),
        ("cart", None),
        ("@bern", None),
        ("cart@", None),
    ],
)
def test_the_site_follows_the_last_sign(name: str, far: FarName | None) -> None:
    """Robots of this server have no sign."""
    assert far_name(name) == far
    if far is not None:
        assert str(far) == name


@pytest.mark.parametrize(
    ("path", "target"),
    [
        ("/api/v1/robots/cart@bern", "/api/v1/robots/cart"),
        ("/api/v1/robots/cart@bern/stop", "/api/v1/robots/cart/stop"),
        ("/api/v1/robots/a b@bern/signals/x y", "/api/v1/robots/a%20b/signals/x%20y"),
        ("/robots/cart@bern/card", "/robots/cart/card"),
        ("/robots/cart@bern/", None),
        ("/robots/cart@bern/settings", None),
        ("/api/v1/robots/cart/stop", None),
        ("/api/v1/people", None),
    ],
)
def test_api_calls_and_cards_go_to_the_site_and_pages_stay(path: str, target: str | None) -> None:
    """A page is made here."""
    found = far_target(path)
    assert (found[1] if found is not None else None) == target


def test_a_socket_keeps_its_other_parameters() -> None:
    """Only the name changes."""
    found = far_query(b"robot=cart%40bern&watch=&key=a%26b")
    assert found == (FarName("cart", "bern"), "robot=cart&watch=&key=a%26b")
    assert far_query(b"robot=cart") is None
    assert far_query(b"") is None

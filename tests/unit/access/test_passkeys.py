"""Passkeys: both ceremonies with a software authenticator, and every way to cheat in them."""

import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.authenticator import VERIFIED, Authenticator, b64, unb64
from urc.access.directory import Principal
from urc.access.grants import AccessError, Grant
from urc.access.passkey_table import MOST_PASSKEYS, PasskeyTable
from urc.access.passkeys import CHALLENGE_S, Passkeys, RelyingParty, relying_party
from urc.access.store import AccessStore

NOW = 1_000_000.0
ORIGIN = "https://cart.lab:8443"
PARTY = relying_party("cart.lab", 8443)
PLACE = "192.0.2.1"


class House:
    """One server with one person, and the person's phone."""

    def __init__(self, store: AccessStore) -> None:
        self.time = 0.0
        self.store = store
        self.table = PasskeyTable(store)
        self.passkeys = Passkeys(self.table, lambda: self.time)
        self.ann = store.add("person", "Ann", [Grant("drive")], now=NOW)
        self.phone = Authenticator(ORIGIN)

    def register(self, owner: Principal | None = None, name: str = "phone") -> str:
        owner = owner or self.ann
        options = self.passkeys.registration(owner, PARTY, PLACE)
        made = self.phone.create(options)
        return self.passkeys.register(owner, PARTY, made, name, NOW).id

    def sign_in(self) -> str:
        answer = self.phone.get(self.passkeys.authentication(PARTY, PLACE))
        return self.passkeys.authenticate(PARTY, answer, NOW + 5).principal


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    store = AccessStore(tmp_path / "data")
    yield House(store)
    store.close()


def test_a_registered_passkey_signs_its_owner_in(house: House) -> None:
    passkey = house.register(name="  Ann's   phone ")
    assert house.sign_in() == house.ann.id
    (kept,) = house.table.of(house.ann.id)
    assert (kept.id, kept.name, kept.host) == (passkey, "Ann's phone", "cart.lab")
    assert (kept.counter, kept.created_at, kept.used_at) == (1, NOW, NOW + 5)
    assert house.sign_in() == house.ann.id


def test_options_ask_for_a_passkey_that_needs_no_name(house: House) -> None:
    house.register()
    options = house.passkeys.registration(house.ann, PARTY, PLACE)
    assert options["rp"] == {"name": "URC", "id": "cart.lab"}
    assert unb64(options["user"]["id"]).decode() == house.ann.id
    assert options["attestation"] == "none"
    chosen = options["authenticatorSelection"]
    assert (chosen["residentKey"], chosen["userVerification"]) == ("required", "preferred")
    known = [each["id"] for each in options["excludeCredentials"]]
    assert known == [b64(house.phone.credentials[0].id)], "one passkey for each device"
    asked = house.passkeys.authentication(PARTY, PLACE)
    assert asked["allowCredentials"] == [], "the page does not tell which passkeys exist"
    assert len(unb64(asked["challenge"])) == 32
    json.dumps([options, asked])


def test_verification_is_preferred_but_presence_is_needed(house: House) -> None:
    house.register()
    house.phone.flags &= ~VERIFIED
    assert house.sign_in() == house.ann.id
    house.phone.flags = 0
    with pytest.raises(AccessError, match="the passkey was refused"):
        house.sign_in()


def test_each_challenge_is_valid_once(house: House) -> None:
    options = house.passkeys.registration(house.ann, PARTY, PLACE)
    made = house.phone.create(options)
    house.passkeys.register(house.ann, PARTY, made, "phone", NOW)
    with pytest.raises(AccessError, match="already complete"):
        house.passkeys.register(house.ann, PARTY, made, "again", NOW)
    answer = house.phone.get(house.passkeys.authentication(PARTY, PLACE))
    house.passkeys.authenticate(PARTY, answer, NOW)
    with pytest.raises(AccessError, match="already complete"):
        house.passkeys.authenticate(PARTY, answer, NOW)


def test_a_late_answer_is_refused(house: House) -> None:
    house.register()
    answer = house.phone.get(house.passkeys.authentication(PARTY, PLACE))
    house.time = CHALLENGE_S
    with pytest.raises(AccessError, match="took too long"):
        house.passkeys.authenticate(PARTY, answer, NOW)


def test_a_challenge_belongs_to_one_person_and_one_ceremony(house: House) -> None:
    eve = house.store.add("person", "Eve", now=NOW)
    made = house.phone.create(house.passkeys.registration(house.ann, PARTY, PLACE))
    with pytest.raises(AccessError, match="try again"):
        house.passkeys.register(eve, PARTY, made, "hers", NOW)
    house.register()
    for_sign_in = house.passkeys.authentication(PARTY, PLACE)
    mixed = house.passkeys.registration(house.ann, PARTY, PLACE)
    mixed["challenge"] = for_sign_in["challenge"]
    with pytest.raises(AccessError, match="try again"):
        house.passkeys.register(house.ann, PARTY, house.phone.create(mixed), "mixed", NOW)
    assert len(house.table.of(house.ann.id)) == 1


def _other_origin(phone: Authenticator, _: dict[str, Any]) -> None:
    phone.origin = "https://cart.lab.example"


def _other_port(phone: Authenticator, _: dict[str, Any]) -> None:
    phone.origin = "https://cart.lab"


def _plain(phone: Authenticator, _: dict[str, Any]) -> None:
    phone.origin = "http://cart.lab:8443"


def _framed(phone: Authenticator, _: dict[str, Any]) -> None:
    phone.extra["crossOrigin"] = True


def _other_kind(phone: Authenticator, _: dict[str, Any]) -> None:
    phone.extra["type"] = "webauthn.create"


def _other_challenge(_: Authenticator, options: dict[str, Any]) -> None:
    options["challenge"] = b64(bytes(32))


def _other_host(phone: Authenticator, _: dict[str, Any]) -> None:
    phone.credentials[0].host = "evil.lab"
    _["rpId"] = "evil.lab"


def _other_owner(phone: Authenticator, _: dict[str, Any]) -> None:
    phone.credentials[0].user = b"another person"


def _other_key(phone: Authenticator, _: dict[str, Any]) -> None:
    made = Authenticator(ORIGIN)
    made.create({"pubKeyCredParams": [{"alg": -7}], "rp": {"id": "x"}, "user": {"id": ""}}
                | {"challenge": ""})  # fmt: skip
    phone.credentials[0].key = made.credentials[0].key


def _unknown(phone: Authenticator, _: dict[str, Any]) -> None:
    phone.credentials[0].id = bytes(32)


@pytest.mark.parametrize(
    "change",
    [
        _other_origin, _other_port, _plain, _framed, _other_kind, _other_challenge, _other_host,
        _other_owner, _other_key, _unknown,
    ],
)  # fmt: skip
def test_a_forged_sign_in_is_refused(
    house: House, change: Callable[[Authenticator, dict[str, Any]], None]
) -> None:
    house.register()
    options = house.passkeys.authentication(PARTY, PLACE)
    change(house.phone, options)
    with pytest.raises(AccessError):
        house.passkeys.authenticate(PARTY, house.phone.get(options), NOW)
    assert house.table.of(house.ann.id)[0].used_at == NOW, "nothing was recorded"


@pytest.mark.parametrize("change", [_other_origin, _other_port, _plain, _framed, _other_challenge])
def test_a_forged_registration_is_refused(
    house: House, change: Callable[[Authenticator, dict[str, Any]], None]
) -> None:
    options = house.passkeys.registration(house.ann, PARTY, PLACE)
    change(house.phone, options)
    with pytest.raises(AccessError):
        house.passkeys.register(house.ann, PARTY, house.phone.create(options), "phone", NOW)
    assert house.table.of(house.ann.id) == []


def test_a_passkey_of_one_name_is_unknown_to_another(house: House) -> None:
    house.register()
    elsewhere = relying_party("robot.lab", None)
    house.phone.origin, house.phone.credentials[0].host = "https://robot.lab", "robot.lab"
    answer = house.phone.get(house.passkeys.authentication(elsewhere, PLACE))
    with pytest.raises(AccessError, match="does not know the passkey"):
        house.passkeys.authenticate(elsewhere, answer, NOW)
    assert house.passkeys.registration(house.ann, elsewhere, PLACE)["excludeCredentials"] == []


def test_a_copied_passkey_shows_by_its_counter(house: House) -> None:
    house.register()
    house.sign_in()
    house.sign_in()
    house.phone.credentials[0].count = 1
    with pytest.raises(AccessError, match="may have been copied"):
        house.sign_in()
    assert house.table.of(house.ann.id)[0].counter == 2


def test_a_counter_that_stays_is_refused_and_a_passkey_without_one_is_accepted(
    house: House,
) -> None:
    house.phone.has_counter = False
    house.register()
    assert (house.sign_in(), house.sign_in()) == (house.ann.id, house.ann.id)
    house.phone.credentials[0].count = 7
    house.sign_in()
    with pytest.raises(AccessError, match="may have been copied"):
        house.sign_in()


def test_passkeys_are_named_and_removed_by_their_owner_only(house: House) -> None:
    eve = house.store.add("person", "Eve", now=NOW)
    passkey = house.register()
    for attempt in (
        lambda: house.table.rename(eve.id, passkey, "mine"),
        lambda: house.table.remove(eve.id, passkey),
        lambda: house.table.rename(house.ann.id, "guess", "mine"),
    ):
        with pytest.raises(AccessError, match="this passkey was removed"):
            attempt()
    house.table.rename(house.ann.id, passkey, "work phone")
    assert [each.name for each in house.table.of(house.ann.id)] == ["work phone"]
    with pytest.raises(AccessError, match="the name is empty"):
        house.table.rename(house.ann.id, passkey, " ")
    house.table.remove(house.ann.id, passkey)
    with pytest.raises(AccessError, match="does not know the passkey"):
        house.sign_in()


def test_a_removed_person_leaves_no_passkey(house: House) -> None:
    house.register()
    house.store.remove(house.ann.id)
    with pytest.raises(AccessError, match="does not know the passkey"):
        house.sign_in()


def test_only_people_have_passkeys_and_not_too_many(house: House) -> None:
    device = house.store.add("device", "Tablet", now=NOW)
    local = Principal("local", "person", "this computer")
    for owner in (device, local):
        with pytest.raises(AccessError, match="only people have passkeys"):
            house.register(owner)
    for each in range(MOST_PASSKEYS):
        house.register(name=f"key {each}")
    kept = house.table.of(house.ann.id)
    with pytest.raises(AccessError, match=f"you have {MOST_PASSKEYS} passkeys"):
        house.passkeys.registration(house.ann, PARTY, PLACE)
    with pytest.raises(AccessError, match=f"you have {MOST_PASSKEYS} passkeys"):
        house.table.add(kept[0]._replace(id="another"))


def test_a_passkey_is_registered_once(house: House) -> None:
    house.register()
    eve = house.store.add("person", "Eve", now=NOW)
    (kept,) = house.table.of(house.ann.id)
    with pytest.raises(AccessError, match="already registered"):
        house.table.add(kept._replace(principal=eve.id))
    assert house.table.of(eve.id) == []


def test_another_process_sees_the_passkeys(house: House, tmp_path: Path) -> None:
    passkey = house.register()
    other = AccessStore(tmp_path / "data")
    try:
        assert [each.id for each in PasskeyTable(other).of(house.ann.id)] == [passkey]
    finally:
        other.close()


@pytest.mark.parametrize(
    ("host", "port", "party"),
    [
        ("Cart.Lab.", None, RelyingParty("cart.lab", ("https://cart.lab",))),
        ("cart.lab", 443, RelyingParty("cart.lab", ("https://cart.lab",))),
        ("cart.lab", 80, RelyingParty("cart.lab", ("https://cart.lab:80",))),
        (
            "localhost",
            8080,
            RelyingParty("localhost", ("https://localhost:8080", "http://localhost:8080")),
        ),
        (
            "localhost",
            80,
            RelyingParty("localhost", ("https://localhost:80", "http://localhost")),
        ),
    ],
)
def test_passkeys_belong_to_the_host_name(host: str, port: int | None, party: RelyingParty) -> None:
    assert relying_party(host, port) == party


@pytest.mark.parametrize("host", ["192.0.2.1", "127.0.0.1", "[::1]", "[fe80::1]"])
def test_an_address_has_no_passkeys(host: str) -> None:
    with pytest.raises(AccessError, match="open this page by its host name"):
        relying_party(host, 8080)


WORDS = st.one_of(
    st.none(), st.booleans(), st.integers(), st.text(max_size=20), st.binary(max_size=80).map(b64)
)
JSON = st.recursive(
    WORDS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3)
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_answer_breaks_the_server(data: st.DataObject, house: House) -> None:
    """Any JSON in place of any part of an answer is refused in one line."""
    if not house.phone.credentials:
        house.register()
    answer: Any = house.phone.get(house.passkeys.authentication(PARTY, PLACE))
    parts = ["id", "rawId", "type", "response", "clientDataJSON", "authenticatorData", "signature"]
    part = data.draw(st.sampled_from(parts))
    (answer if part in answer else answer["response"])[part] = data.draw(JSON)
    with pytest.raises(AccessError):
        house.passkeys.authenticate(PARTY, answer, NOW)
    with pytest.raises(AccessError):
        house.passkeys.authenticate(PARTY, data.draw(JSON), NOW)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_attestation_breaks_the_server(data: st.DataObject, house: House) -> None:
    """Any change of the attested bytes raises no error of a parser."""
    made: Any = Authenticator(ORIGIN).create(house.passkeys.registration(house.ann, PARTY, PLACE))
    attested = bytearray(unb64(made["response"]["attestationObject"]))
    for _ in range(data.draw(st.integers(1, 4))):
        attested[data.draw(st.integers(0, len(attested) - 1))] = data.draw(st.integers(0, 255))
    made["response"]["attestationObject"] = b64(bytes(attested))
    # A changed key or id is another valid passkey: nothing is attested.
    with suppress(AccessError):
        passkey = house.passkeys.register(house.ann, PARTY, made, "phone", NOW)
        house.table.remove(house.ann.id, passkey.id)

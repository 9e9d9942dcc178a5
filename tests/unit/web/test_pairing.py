"""Pairing of devices, invitations and guest links over HTTP."""

import base64
import re
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.unit.web.people import PASSPHRASE, Door, post
from urc.access.lifetimes import DEVICE, PAIRING_S
from urc.access.throttle import FREE
from urc.runtime.audit_search import AuditQuery, search


@pytest.fixture
def door(tmp_path: Path) -> Iterator[Door]:
    with closing(Door(tmp_path)) as opened:
        yield opened


def test_a_device_pairs_and_both_screens_show_the_same_number(door: Door) -> None:
    with door.browser(cookies=door.signed_in("Ann", "administer")) as admin:
        status, code = post(admin, "devices/pair", roles=["drive@puppet"])
        assert status == 200
        assert code["lastsS"] == PAIRING_S
        assert code["link"].endswith(f"/pair#{code['code']}")
        state = f"/api/v1/pairings/{code['id']}"
        assert admin.get(state).json()["state"] == "waiting"

        tablet = door.other(admin)
        assert tablet.get("/pair").status_code == 200
        status, info = post(tablet, "codes", code=code["code"])
        assert (info["kind"], info["roles"]) == ("device", ["drive@puppet"])
        status, paired = post(tablet, "pair", code=code["code"], name="Tablet in the lab")
        assert status == 200
        assert [one["url"] for one in paired["robots"]] == ["/robots/puppet/"]
        assert re.fullmatch(r"\d\d \d\d", paired["check"])
        seen = admin.get(state).json()
        assert (seen["state"], seen["name"]) == ("paired", "Tablet in the lab")
        assert seen["check"] == paired["check"]
        assert tablet.get("/robots/puppet/").status_code == 200
        assert tablet.get("/people").status_code == 403
        (key,) = [
            one for one in door.access.control.directory.sign_ins.values() if one.way == "pairing"
        ]
        assert (key.ends_at, key.idle_s) == DEVICE


def test_a_code_works_once(door: Door) -> None:
    with door.browser(cookies=door.signed_in("Ann", "administer")) as admin:
        _, code = post(admin, "devices/pair", roles=["drive"])
        first, second = door.other(admin), door.other(admin, "192.0.2.9")
        assert post(first, "pair", code=code["code"], name="One")[0] == 200
        assert post(second, "pair", code=code["code"], name="Two")[0] == 403
        assert second.get("/").status_code == 401


def test_a_name_in_use_leaves_the_code_valid(door: Door) -> None:
    with door.browser(cookies=door.signed_in("Ann", "administer")) as admin:
        _, one = post(admin, "devices/pair", roles=["drive"])
        assert post(door.other(admin), "pair", code=one["code"], name="Phone")[0] == 200
        _, two = post(admin, "devices/pair", roles=["drive"])
        phone = door.other(admin)
        status, said = post(phone, "pair", code=two["code"], name="phone")
        assert status == 403
        assert "already" in said["error"]
        assert post(phone, "pair", code=two["code"], name="Phone 2")[0] == 200


def test_guessed_codes_make_the_address_wait(door: Door) -> None:
    with door.browser() as thief:
        assert {post(thief, "codes", code=f"guess {n}")[0] for n in range(FREE)} == {403}
        assert post(thief, "pair", code="guess", name="Thief")[0] == 429


def test_a_device_of_a_person_has_the_roles_of_the_person(door: Door) -> None:
    with door.browser(cookies=door.signed_in("Ben", "drive@puppet")) as ben:
        _, code = post(ben, "account/devices/pair")
        phone = door.other(ben)
        _, info = post(phone, "codes", code=code["code"])
        assert (info["owner"], info["roles"]) == ("Ben", ["drive@puppet"])
        assert post(phone, "pair", code=code["code"], name="Ben's phone")[0] == 200
        assert phone.get("/robots/puppet/").status_code == 200
        assert phone.get("/api/v1/account").json()["kind"] == "device"


def test_a_paired_device_stays_paired_when_its_operator_signs_out(door: Door) -> None:
    door.add("Ann", "administer", passphrase=PASSPHRASE)
    with door.browser() as tablet:
        assert post(tablet, "sign-in", name="Ann", passphrase=PASSPHRASE)[0] == 200
        _, code = post(tablet, "devices/pair", roles=["watch"])
        assert post(tablet, "pair", code=code["code"], name="Tablet")[0] == 200
        assert tablet.get("/api/v1/account").json()["name"] == "Ann"
        assert post(tablet, "sign-out")[0] == 200
        assert tablet.get("/api/v1/account").json()["name"] == "Tablet"
        assert tablet.get("/people").status_code == 403


def test_the_qr_code_is_dark_on_white_with_a_quiet_zone(door: Door) -> None:
    with door.browser(cookies=door.signed_in("Ann", "administer")) as admin:
        _, code = post(admin, "devices/pair", roles=["drive"])
    kind, _, data = code["qr"].partition(",")
    assert kind.startswith("data:image/svg+xml")
    svg = base64.b64decode(data).decode() if "base64" in kind else data
    assert "fff" in svg


def test_a_device_has_an_owner_or_roles(door: Door) -> None:
    ben = door.add("Ben", "drive")
    with door.browser(cookies=door.signed_in("Ann", "administer")) as admin:
        assert post(admin, "devices/pair")[0] == 422
        assert post(admin, "devices/pair", owner=ben, roles=["drive"])[0] == 422
        assert post(admin, "devices/pair", owner=ben)[0] == 200
        assert post(admin, "devices/pair", owner="unknown")[0] == 404


def test_an_invited_person_chooses_a_passphrase(door: Door) -> None:
    ben = door.add("Ben", "drive")
    with door.browser(cookies=door.signed_in("Ann", "administer")) as admin:
        status, made = post(admin, "people/invite", id=ben)
        assert status == 200
        page, code = made["link"].split("#")
        assert page.endswith("/join")
        browser = door.other(admin)
        _, info = post(browser, "codes", code=code)
        assert (info["kind"], info["name"], info["roles"]) == ("person", "Ben", ["drive"])
        status, said = post(browser, "join", code=code, passphrase="short")  # noqa: S106 - of a test
        assert status == 422
        assert "at least 8" in said["error"]
        assert post(browser, "join", code=code, passphrase=PASSPHRASE)[0] == 200
        assert browser.get("/api/v1/account").json()["name"] == "Ben"
        assert post(browser, "join", code=code, passphrase=PASSPHRASE)[0] == 403
        assert post(door.other(admin), "sign-in", name="Ben", passphrase=PASSPHRASE)[0] == 200


def test_a_code_of_a_device_sets_no_passphrase_and_an_invitation_pairs_nothing(
    door: Door,
) -> None:
    ben = door.add("Ben", "drive")
    with door.browser(cookies=door.signed_in("Ann", "administer")) as admin:
        _, code = post(admin, "devices/pair", owner=ben)
        assert post(door.other(admin), "join", code=code["code"], passphrase=PASSPHRASE)[0] == 403
        _, made = post(admin, "people/invite", id=ben)
        code = made["link"].partition("#")[2]
        assert post(door.other(admin), "pair", code=code, name="Phone")[0] == 403


def test_a_guest_watches_one_robot_until_the_link_ends(door: Door) -> None:
    with door.browser(cookies=door.signed_in("Ann", "administer")) as admin:
        status, made = post(admin, "guests/add", name="Visitors", robot="puppet", hours=1)
        assert status == 200
        secret = made["link"].partition("#")[2]
        guest = door.other(admin)
        assert post(guest, "guest", code="wrong")[0] == 403
        assert post(guest, "guest", code=secret) == (200, {"url": "/robots/puppet/"})
        assert guest.get("/robots/puppet/").status_code == 200
        assert guest.get("/api/v1/people").status_code == 403
        (one,) = admin.get("/api/v1/guests").json()["entries"]
        assert one["roles"] == ["watch@puppet"]
        assert one["endsAt"] is not None
        assert post(admin, "people/roles", id=one["id"], roles=["drive"])[0] == 422
        assert post(admin, "people/remove", id=one["id"])[0] == 200
        assert guest.get("/robots/puppet/").status_code == 401


def test_a_guest_who_signs_out_ends_the_link_for_no_other_guest(door: Door) -> None:
    with door.browser(cookies=door.signed_in("Ann", "administer")) as admin:
        _, made = post(admin, "guests/add", name="Visitors", robot="puppet", hours=1)
        secret = made["link"].partition("#")[2]
        first, second = door.other(admin), door.other(admin)
        for guest in (first, second):
            assert post(guest, "guest", code=secret)[0] == 200
        (shared,) = first.get("/api/v1/account").json()["signIns"]
        assert post(first, "account/sign-ins/end", id=shared["id"])[0] == 409
        assert post(first, "sign-out")[0] == 200
        assert first.get("/robots/puppet/").status_code == 401
        assert second.get("/robots/puppet/").status_code == 200


def test_a_secret_of_a_sign_in_is_no_guest_link(door: Door) -> None:
    cookies = door.signed_in("Ann", "administer")
    with door.browser() as browser:
        assert post(browser, "guest", code=next(iter(cookies.values())))[0] == 403


def test_codes_and_keys_are_not_in_the_audit_log(door: Door) -> None:
    with door.browser(cookies=door.signed_in("Ann", "administer")) as admin:
        _, code = post(admin, "devices/pair", name="Tablet", roles=["drive"])
        tablet = door.other(admin)
        post(tablet, "pair", code=code["code"], name="")
        key = str(next(iter(tablet.cookies.jar)).value)
    found = [one.entry for one in search(door.folder / "audit.sqlite", AuditQuery())]
    assert {one.command for one in found if one.what == "pairing"} == {"code made", "code used"}
    assert code["code"] not in str(found)
    assert key not in str(found)

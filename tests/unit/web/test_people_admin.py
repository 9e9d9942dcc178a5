"""People, devices, tokens and sign-ins over HTTP, for administrators and for oneself."""

from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest

from tests.unit.web.people import PASSPHRASE, Door, post
from urc.access.throttle import FREE
from urc.runtime.audit_search import AuditQuery, search
from urc.web.people.browser_sign_ins import HASHES
from urc.web.serve.rights import FRESH_S


@pytest.fixture
def door(tmp_path: Path) -> Iterator[Door]:
    with closing(Door(tmp_path)) as opened:
        yield opened


def test_only_administrators_manage_people(door: Door) -> None:
    with door.browser(cookies=door.signed_in("Ben", "maintain")) as ben:
        for path in ("people", "devices", "tokens", "guests", "sign-ins"):
            assert ben.get(f"/api/v1/{path}").status_code == 403
        assert ben.get("/people").status_code == 403
        assert post(ben, "people/add", name="Eve", roles=["administer"])[0] == 403
        assert post(ben, "people/roles", id="local", roles=["administer"])[0] == 403


def test_a_person_is_added_granted_renamed_and_removed(door: Door) -> None:
    with door.browser(cookies=door.signed_in("Ann", "administer")) as ann:
        assert ann.get("/people").status_code == 200
        assert post(ann, "people/add", name="Ben", roles=["watch"])[0] == 200
        assert post(ann, "people/add", name="ben", roles=["watch"])[0] == 422
        assert post(ann, "people/add", name="Eve", roles=["king"])[0] == 422
        people = ann.get("/api/v1/people").json()["entries"]
        assert [one["name"] for one in people] == ["Ann", "Ben"]
        ben = people[1]["id"]
        assert post(ann, "people/roles", id=ben, roles=["drive@#lab", "watch"])[0] == 200
        assert post(ann, "people/rename", id=ben, name="Ben Lee")[0] == 200
        ben_now = ann.get("/api/v1/people").json()["entries"][1]
        assert (ben_now["name"], ben_now["roles"]) == ("Ben Lee", ["drive@#lab", "watch"])
        assert post(ann, "people/remove", id=ben)[0] == 200
        assert post(ann, "people/remove", id=ben)[0] == 404
    entries = [one.entry for one in search(door.folder / "audit.sqlite", AuditQuery())]
    made = [(one.command, one.who) for one in entries if one.what == "access"]
    assert {command for command, _ in made} == {
        "people add", "people grant", "people rename", "people remove",
    }  # fmt: skip
    assert {who for _, who in made} == {"Ann"}


def test_the_local_user_is_not_managed(door: Door) -> None:
    with door.browser(cookies=door.signed_in("Ann", "administer")) as ann:
        assert post(ann, "people/remove", id="local")[0] == 404
        assert "local" not in str(ann.get("/api/v1/people").json())


def test_a_token_is_shown_once_and_works(door: Door) -> None:
    with door.browser(cookies=door.signed_in("Ann", "administer")) as ann:
        status, made = post(
            ann, "tokens/add", name="Patrol", roles=["watch@puppet"], commands=["goto"], days=1
        )
        assert status == 200
        assert made["token"] not in ann.get("/api/v1/tokens").text
        program = door.other(ann)
        bearer = {"authorization": f"Bearer {made['token']}"}
        path = "/api/v1/robots/puppet/controls"
        assert program.get(path, headers=bearer).status_code == 200
        assert program.get("/api/v1/people", headers=bearer).status_code == 403
        (one,) = ann.get("/api/v1/tokens").json()["entries"]
        assert one["commands"] == ["goto"]
        assert post(ann, "people/remove", id=one["id"])[0] == 200
        assert program.get(path, headers=bearer).status_code == 401


def test_a_token_for_single_commands_administers_and_maintains_nothing(door: Door) -> None:
    """Otherwise, it would make itself a token for all commands."""
    with door.browser(cookies=door.signed_in("Ann", "administer")) as admin:
        for number, commands in enumerate((["beep"], [])):
            _, made = post(
                admin, "tokens/add", name=f"t{number}", roles=["administer"], commands=commands
            )
            program = door.other(admin)
            program.headers["authorization"] = f"Bearer {made['token']}"
            refused = 403 if commands else 200
            said = {"name": f"u{number}", "roles": ["administer"]}
            assert program.post("/api/v1/tokens/add", json=said).status_code == refused
            assert program.get("/api/v1/audit").status_code == refused
            assert program.get("/api/v1/robots/puppet/controls").status_code == 200


def test_a_token_needs_a_role(door: Door) -> None:
    with door.browser(cookies=door.signed_in("Ann", "administer")) as ann:
        assert post(ann, "tokens/add", name="Patrol", roles=[])[0] == 422
        assert post(ann, "tokens/add", name="Patrol", roles=["watch"], days=-1)[0] == 400


def test_one_sign_in_ends_and_the_others_stay(door: Door) -> None:
    ben = door.add("Ben", "drive", passphrase=PASSPHRASE)
    with door.browser(cookies=door.signed_in("Ann", "administer")) as ann:
        first, second = door.other(ann), door.other(ann)
        for browser in (first, second):
            assert post(browser, "sign-in", name="Ben", passphrase=PASSPHRASE)[0] == 200
        entries = ann.get("/api/v1/sign-ins").json()["entries"]
        of_ben = [one for one in entries if one["principal"] == ben]
        assert len(of_ben) == 2
        assert of_ben[0]["place"] == "192.0.2.8"
        assert [one["name"] for one in entries if one["isOwn"]] == ["Ann"]
        newest = max(of_ben, key=lambda one: one["createdAt"])
        assert post(ann, "sign-ins/end", id=newest["id"])[0] == 200
        assert (first.get("/").status_code, second.get("/").status_code) == (200, 401)
        assert post(ann, "people/revoke", id=ben)[0] == 200
        assert first.get("/").status_code == 401


def test_revoking_ends_devices_of_the_person_too(door: Door) -> None:
    ben = door.add("Ben", "drive")
    with door.browser(cookies=door.signed_in("Ann", "administer")) as ann:
        _, code = post(ann, "devices/pair", owner=ben)
        phone = door.other(ann)
        assert post(phone, "pair", code=code["code"], name="Phone")[0] == 200
        assert post(ann, "people/revoke", id=ben)[0] == 200
        assert phone.get("/").status_code == 401


def test_everyone_sees_only_the_own_account(door: Door) -> None:
    door.signed_in("Ann", "administer")
    with door.browser(cookies=door.signed_in("Ben", "drive")) as ben:
        assert ben.get("/account").status_code == 200
        account = ben.get("/api/v1/account").json()
        assert account["name"] == "Ben"
        assert account["mayPair"]
        assert [one["isOwn"] for one in account["signIns"]] == [True]
        others = [
            one.id
            for one in door.access.control.directory.sign_ins.values()
            if one.id != account["signIns"][0]["id"]
        ]
        for one in others:
            assert post(ben, "account/sign-ins/end", id=one)[0] == 404


def test_a_person_removes_an_own_device_and_no_other(door: Door) -> None:
    cookies = door.signed_in("Ben", "drive")
    with door.browser(cookies=door.signed_in("Ann", "administer")) as ann:
        ben = door.other(ann, cookies=cookies)
        _, own = post(ben, "account/devices/pair")
        _, shared = post(ann, "devices/pair", roles=["drive"])
        phone, tablet = door.other(ann), door.other(ann)
        assert post(phone, "pair", code=own["code"], name="Phone")[0] == 200
        assert post(tablet, "pair", code=shared["code"], name="Tablet")[0] == 200
        (device,) = ben.get("/api/v1/account").json()["devices"]
        assert device["name"] == "Phone"
        other = next(
            one["id"]
            for one in ann.get("/api/v1/devices").json()["entries"]
            if one["name"] == "Tablet"
        )
        assert post(ben, "account/devices/remove", id=other)[0] == 404
        assert post(ben, "account/devices/remove", id=device["id"])[0] == 200
        assert phone.get("/").status_code == 401
        assert tablet.get("/").status_code == 200


def test_a_new_passphrase_needs_the_present_one_and_ends_other_sign_ins(door: Door) -> None:
    door.add("Ben", "drive", passphrase=PASSPHRASE)
    with door.browser() as ben:
        other = door.other(ben)
        for browser in (ben, other):
            assert post(browser, "sign-in", name="Ben", passphrase=PASSPHRASE)[0] == 200
        path, new = "account/passphrase", "four quiet words here"
        assert post(ben, path, current="wrong one", passphrase=new)[0] == 403
        assert post(ben, path, current=PASSPHRASE, passphrase="short")[0] == 422  # noqa: S106 - of a test
        assert post(ben, path, current=PASSPHRASE, passphrase=new)[0] == 200
        assert (ben.get("/").status_code, other.get("/").status_code) == (200, 401)
        assert post(other, "sign-in", name="Ben", passphrase=PASSPHRASE)[0] == 403
        assert post(other, "sign-in", name="Ben", passphrase=new)[0] == 200


def test_guesses_at_the_same_time_wait_like_others(door: Door) -> None:
    """Each guess takes its turn, and looks at the failures of the guesses before."""
    door.add("Ben", "drive", passphrase=PASSPHRASE)
    with door.browser() as ben:
        assert post(ben, "sign-in", name="Ben", passphrase=PASSPHRASE)[0] == 200
        cookies = dict(ben.cookies)
        path, new = "account/passphrase", "four quiet words here"

        def guess(number: int) -> int:
            thief = door.other(ben, cookies=cookies)
            return int(post(thief, path, current=f"guess {number}", passphrase=new)[0])

        with ThreadPoolExecutor(20) as pool:
            found = Counter(pool.map(guess, range(20)))
        assert found[403] <= FREE + HASHES
        assert found[429] == 20 - found[403]


def test_a_passer_by_sets_no_first_passphrase(door: Door) -> None:
    with door.browser(cookies=door.signed_in("Ben", "drive")) as ben:
        control = door.access.control
        now = control.now() + FRESH_S + 1
        control._utc = lambda: now
        assert post(ben, "account/passphrase", current="", passphrase=PASSPHRASE)[0] == 403


def test_the_local_user_and_devices_have_no_passphrase(door: Door) -> None:
    with door.browser() as local:
        local.cookies.set(door.access.cookie, str(door.access.admit(door.access.key)))
        assert local.get("/people").status_code == 200
        assert post(local, "account/passphrase", current="", passphrase=PASSPHRASE)[0] == 409
        assert post(local, "account/devices/pair")[0] == 409
        assert local.get("/api/v1/account").json()["isLocal"]

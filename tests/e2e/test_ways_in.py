"""Ways to sign in, with real programs and a browser: passkeys, a provider from PyPI, a proxy."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from playwright.async_api import Browser, CDPSession, Page, expect

from tests.e2e.axe import faults, prepare
from tests.e2e.command_line import TIMEOUT_S
from tests.e2e.conftest import PageMaker
from tests.e2e.keys import signed_in
from tests.e2e.ports import free_port
from tests.e2e.processes import UrcProcess
from urc.access.grants import Grant
from urc.access.store import AccessStore

pytestmark = pytest.mark.anyio

Start = Callable[..., UrcProcess]
TELLO = "robots/tello.yaml"
MODULE = "import('/static/people/passkey.js')"
SECRET = "0123456789abcdef" * 2


@pytest.fixture(scope="session")
def browser(whole_browser: Browser) -> Browser:
    """The one that people have: the one without windows may lack passkeys."""
    return whole_browser


def start(urc_process: Start, data: Path, *more: str, port: int = 0) -> str:
    """Start the dashboard; give its address by name, because passkeys need one."""
    process = urc_process(
        "serve", TELLO, "--simulate", "--port", str(port), "--data-dir", str(data), *more
    )
    address = process.wait_for(r"^dashboard (http://\S+)")[1]
    return str(address).replace("127.0.0.1", "localhost")


async def with_authenticator(page: Page) -> tuple[CDPSession, str]:
    """Give the page's browser a virtual phone, which agrees to everything."""
    session = await page.context.new_cdp_session(page)
    await session.send("WebAuthn.enable")
    options = {
        "protocol": "ctap2", "transport": "internal", "hasResidentKey": True,
        "hasUserVerification": True, "isUserVerified": True, "automaticPresenceSimulation": True,
    }  # fmt: skip
    made = await session.send("WebAuthn.addVirtualAuthenticator", {"options": options})
    return session, made["authenticatorId"]


async def stranger(page: Page, address: str) -> None:
    """Open the sign-in page as a browser without any sign-in."""
    await page.goto(f"{address}static/favicon.svg")  # the page hands in the start key by itself
    await page.context.clear_cookies()
    await page.goto(address)
    await expect(page.locator("h1")).to_have_text("Sign in")


def is_refused(text: str) -> bool:
    """Return whether the browser reports an answer that these tests ask for."""
    return "status of 401" in text or "status of 403" in text


async def call(page: Page, words: str) -> object:
    """Call a function of the module; give its result, or the reason of its failure."""
    return await page.evaluate(f"{MODULE}.then((one) => one.{words}).catch((why) => why.message)")


async def test_a_passkey_is_added_and_signs_in(
    urc_process: Start, tmp_path: Path, new_page: PageMaker
) -> None:
    address = start(urc_process, tmp_path)
    page = await new_page()
    new_page.allow(page, is_refused)
    await signed_in(page.context, address, tmp_path, "Ann", "watch")
    await page.goto(address)
    session, phone = await with_authenticator(page)
    assert await call(page, "obstacle()") == ""
    await page.goto(f"{address}account")
    part = page.locator("[data-passkeys]")
    await expect(part).to_contain_text("No passkeys yet.")
    await part.get_by_label("Name of the new passkey").fill("Ann’s phone")
    await part.get_by_role("button", name="Add a passkey").click()
    await expect(page.locator("[data-said]")).to_have_text("✓ The passkey was added.")
    await expect(part.get_by_label("Name of the passkey")).to_have_value("Ann’s phone")
    await expect(part.locator(".urc-row")).to_contain_text("localhost")
    await part.get_by_role("button", name="Add a passkey").click()
    already = "This device already has a passkey."
    await expect(page.locator("[data-said]")).to_contain_text(already)
    found = await session.send("WebAuthn.getCredentials", {"authenticatorId": phone})
    (kept,) = found["credentials"]
    assert (kept["isResidentCredential"], kept["rpId"]) == (True, "localhost")

    await stranger(page, address)
    await page.get_by_role("button", name="Sign in with a passkey").click()
    await expect(page.get_by_role("link", name="Tello").first).to_be_visible()

    await page.goto(f"{address}account")
    await expect(part.locator(".urc-row")).to_contain_text("last use")
    await part.get_by_label("Name of the passkey").fill("Old phone")
    await part.get_by_label("Name of the passkey").press("Enter")
    await expect(page.locator("[data-said]")).to_have_text("✓ The passkey was renamed.")
    await part.get_by_role("button", name="Remove Old phone").click()
    await page.get_by_role("dialog").get_by_role("button", name="Remove").click()
    await expect(part).to_contain_text("No passkeys yet.")
    await stranger(page, address)
    await page.get_by_role("button", name="Sign in with a passkey").click()
    refused = "this server does not know the passkey: it may have been removed"
    await expect(page.locator("[data-way-said]")).to_contain_text(refused)


@pytest.mark.needs("axe")
async def test_passkeys_are_usable_without_sight_or_pointer(
    urc_process: Start, tmp_path: Path, new_page: PageMaker
) -> None:
    address = start(urc_process, tmp_path)
    page = await prepare(await new_page("phone"))
    new_page.allow(page, is_refused)
    await signed_in(page.context, address, tmp_path, "Ann", "watch")
    await page.goto(f"{address}account")
    await with_authenticator(page)
    name = page.get_by_label("Name of the new passkey")
    await name.fill("")
    await name.press("Enter")
    await expect(page.locator("[data-said]")).to_contain_text("Enter a name for the passkey.")
    await expect(name).to_be_focused()
    await name.fill("phone")
    await name.press("Enter")
    await expect(page.get_by_label("Name of the passkey")).to_have_value("phone")
    assert await faults(page) == []
    await stranger(page, address)
    assert await faults(page) == []


async def test_a_copied_passkey_is_refused(
    urc_process: Start, tmp_path: Path, new_page: PageMaker
) -> None:
    """Its counter is that of the time of the copy."""
    address = start(urc_process, tmp_path)
    page = await new_page()
    new_page.allow(page, is_refused)
    await signed_in(page.context, address, tmp_path, "Ann", "watch")
    await page.goto(address)
    session, phone = await with_authenticator(page)
    await call(page, "addPasskey('phone')")
    found = await session.send("WebAuthn.getCredentials", {"authenticatorId": phone})
    assert await call(page, "signInWithPasskey()") == "Ann"
    await session.send("WebAuthn.clearCredentials", {"authenticatorId": phone})
    copy = {"authenticatorId": phone, "credential": found["credentials"][0]}
    await session.send("WebAuthn.addCredential", copy)
    refused = await call(page, "signInWithPasskey()")
    assert "its counter did not increase" in str(refused)


async def test_an_address_of_numbers_says_why_it_has_no_passkeys(
    urc_process: Start, tmp_path: Path, new_page: PageMaker
) -> None:
    address = start(urc_process, tmp_path).replace("localhost", "127.0.0.1")
    page = await new_page()
    new_page.allow(page, is_refused)
    await page.goto(address)
    assert "Open this page by its host name." in str(await call(page, "obstacle()"))
    assert "Open this page by its host name." in str(await call(page, "signInWithPasskey()"))


@contextmanager
def provider(*users: dict[str, object]) -> Iterator[str]:
    """Run an OpenID Connect provider that others wrote; give its address.

    It knows registered servers only, and insists on their secrets and redirect addresses.
    """
    port = free_port()
    given = [word for user in users for word in ("--user-claims", json.dumps(user))]
    process = subprocess.Popen(
        [
            sys.executable, "-m", "oidc_provider_mock", "--port", str(port), "--require-nonce",
            "--require-registration", *given,
        ],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=os.environ | {"PYTHONWARNINGS": "ignore"},
    )  # fmt: skip
    address = f"http://127.0.0.1:{port}"
    try:
        end = time.monotonic() + TIMEOUT_S
        while asked(f"{address}/.well-known/openid-configuration")[0] != 200:
            assert time.monotonic() < end
            assert process.poll() is None
            time.sleep(0.1)
        yield address
    finally:
        process.terminate()
        process.wait(TIMEOUT_S)


def registered(issuer: str, redirect: str) -> tuple[str, str]:
    """Register a server with a redirect address; give its id and its secret."""
    body = json.dumps({"redirect_uris": [redirect]}).encode()
    headers = {"content-type": "application/json"}
    request = Request(f"{issuer}/oauth2/clients", body, headers)  # noqa: S310 (this machine)
    with urlopen(request, timeout=TIMEOUT_S) as answer:  # noqa: S310
        made = json.load(answer)
    return made["client_id"], made["client_secret"]


def asked(url: str, method: str = "GET", **headers: str) -> tuple[int, str]:
    """Return status and text of an answer; 0 without one."""
    request = Request(url, headers=headers, method=method)  # noqa: S310 (this machine)
    try:
        with urlopen(request, timeout=TIMEOUT_S) as answer:  # noqa: S310
            return answer.status, answer.read().decode()
    except HTTPError as error:
        with error:
            return error.code, error.read().decode()
    except OSError:
        return 0, ""


def private(file: Path, text: str) -> Path:
    """Write a file that only its owner may read."""
    file.write_text(text)
    file.chmod(0o600)
    return file


async def test_an_account_of_a_provider_signs_in(
    urc_process: Start, tmp_path: Path, new_page: PageMaker
) -> None:
    """In a group it drives; out of the group it is refused, and loses what it had."""
    ann = {"sub": "17", "preferred_username": "ann", "groups": ["drivers"]}
    eve = {"sub": "18", "preferred_username": "eve", "groups": ["guests"]}
    data, port = tmp_path / "data", free_port()
    with provider(ann, eve) as issuer:
        ours, secret = registered(issuer, f"http://localhost:{port}/sign-in/oidc/callback")
        private(tmp_path / "secret", secret)
        options = tmp_path / "oidc.yaml"
        options.write_text(
            f"issuer: {issuer}\nclient_id: {ours}\nclient_secret_file: secret\ntitle: Lab\n"
            "grants: [{claim: groups, value: drivers, grant: drive}]\n"
        )
        address = start(urc_process, data, "--oidc", str(options), port=port)
        page = await new_page()
        # Pages of the provider ask for a style sheet from the internet, and have no icon.
        new_page.allow(
            page, lambda text: is_refused(text) or "cdn." in text or "favicon.ico" in text
        )

        async def sign_in(name: str) -> None:
            await stranger(page, address)
            await page.get_by_role("button", name="Sign in with Lab").click()
            await page.wait_for_url(f"{issuer}/**")
            await page.get_by_role("button", name=name).click()

        async with page.expect_request(lambda request: "code=" in request.url) as back:
            await sign_in("17")
        assert "state=" in (await back.value).url
        await page.wait_for_url(address)
        await expect(page.get_by_role("link", name="Tello").first).to_be_visible()
        # The code has been used: the way back leads in once.
        assert asked((await back.value).url)[0] == 403
        with closing(AccessStore(data)) as store:
            directory = store.directory()
            (person,) = directory.principals.values()
            assert (person.name, person.grants) == ("ann", (Grant("drive"),))
            assert [one.way for one in directory.sign_ins.values()] == ["oidc"]

        await sign_in("18")
        await expect(page.locator(".urc-fault")).to_contain_text("'eve' has no role here")
        await page.get_by_role("link", name="Back to the sign-in").click()
        await expect(page.locator("h1")).to_have_text("Sign in")


def test_a_proxy_names_people_by_its_secret(urc_process: Start, tmp_path: Path) -> None:
    private(tmp_path / "secret", SECRET)
    file = tmp_path / "proxy.yaml"
    file.write_text(
        "name: gate\nuser_header: X-Forwarded-User\nsecret_header: X-Gate-Secret\n"
        "secret_file: secret\nnew_people: [watch]\n"
    )
    data = tmp_path / "data"
    address = start(urc_process, data, "--trust-proxy", str(file))
    page = f"{address}robots/tello/"
    named = {"X-Forwarded-User": "ann"}
    assert asked(page, **named)[0] == 401
    assert asked(page, **named, **{"X-Gate-Secret": "guess"})[0] == 401
    assert asked(page, **named, **{"X-Gate-Secret": SECRET})[0] == 200
    settings = f"{address}api/v1/robots/tello/settings"
    proof = {"X-Gate-Secret": SECRET, "Origin": address.rstrip("/")}
    assert asked(settings, "POST", **named, **proof)[0] == 403, "it may only watch"
    with closing(AccessStore(data)) as store:
        (ann,) = store.directory().principals.values()
        store.remove(ann.id)
        end = time.monotonic() + TIMEOUT_S
        while not (people := store.directory().principals):
            assert time.monotonic() < end
            assert asked(page, **named, **{"X-Gate-Secret": SECRET})[0] == 200
        assert ann.id not in people, "the proxy is the source of people"


def test_mistakes_in_files_are_told_with_their_line(urc_process: Start, tmp_path: Path) -> None:
    file = tmp_path / "oidc.yaml"
    file.write_text("issuer: http://id.example\nclient_id: urc\n")
    process = urc_process("serve", TELLO, "--simulate", "--port", "0", "--oidc", str(file))
    assert process.wait_for("expected an address with https://")
    assert process.wait_for(r"oidc\.yaml:1:9: error")
    assert process.wait() in (1, 2)

"""The whole way of a phone: QR code, trust in the authority, pairing and driving over TLS.

The phone has a browser profile of its own. No flag ignores certificates, and no address besides the
server's is opened. The report of the tests has the times of both parts: trusting once, and every
later visit.
"""

import asyncio
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.async_api import Error, Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.motion.driving import centre, fingers_on
from tests.e2e.test_pairing import code_on
from tests.e2e.test_trust import Start, person, typed
from urc.runtime.audit_search import AuditQuery, AuditRow, search

pytestmark = pytest.mark.anyio

LONGEST_S = 15.0
MOST_TAPS = 3
NAME = "Phone at the door"
STICK = ".joystick >> nth=1"


async def drive(phone: Page) -> None:
    """Push the stick with a finger, and let go."""
    x, y = await centre(phone, STICK)
    fingers = await fingers_on(phone)
    await fingers.put(0, x, y)
    for step in range(1, 11):
        await fingers.put(0, x, y - 5 * step)
        await asyncio.sleep(0.05)
    await fingers.lift(0)


def moved_by(data: Path, name: str) -> list[AuditRow]:
    """Return the motions that the audit log knows of a device."""
    rows = search(data / "audit.sqlite", AuditQuery())
    return [one for one in rows if one.entry.what == "moved" and one.entry.who == name]


@pytest.mark.needs("chromium", "certutil")
async def test_a_phone_scans_trusts_pairs_and_drives_over_tls(
    urc_process: Start,
    new_page: PageMaker,
    tmp_path: Path,
    record_property: Callable[[str, object], None],
) -> None:
    data, home = tmp_path / "data", tmp_path / "home"
    home.mkdir()
    process = urc_process(
        "serve", "robots/tello.yaml", "--simulate", "--host", "0.0.0.0", "--port", "0",
        "--data-dir", str(data),
    )  # fmt: skip
    own = (await process.wait_for_async(r"^dashboard (http://\S+)"))[1]
    others = (await process.wait_for_async(r"^for others (https://\S+)"))[1]
    admin = await new_page()
    await admin.goto(f"{own}people")
    await admin.locator("[data-add=device] [name=name]").fill(NAME)
    await admin.locator("[data-add=device] [type=submit]").click()
    link = await code_on(admin)
    assert link.startswith(f"{others}pair#")

    began_s = time.monotonic()
    async with person(home) as context:
        phone = await context.new_page()
        with pytest.raises(Error, match="ERR_CERT_AUTHORITY_INVALID"):
            await phone.goto(link)
        phone = await context.new_page()
        await phone.goto(others.replace("https://", "http://") + "trust")
        async with phone.expect_download() as downloading:
            await phone.locator("[data-download]").click()
        await (await downloading.value).save_as(home / "authority.crt")
        command = await phone.locator("[data-guide=linux] ol code").inner_text()
    await asyncio.to_thread(typed, home, command)
    trusted_s = time.monotonic() - began_s

    taps = 0
    async with person(home) as context:
        phone = await context.new_page()
        began_s = time.monotonic()
        await phone.goto(link)
        for name, role in (("Pair this device", "button"), ("Connect to", "link")):
            await phone.get_by_role(role, name=name).tap()  # type: ignore[arg-type]
            taps += 1
        await phone.locator("[data-verb=take]").tap()
        taps += 1
        await expect(phone.locator("[data-controls]")).to_have_attribute("data-state", "mine")
        took_s = time.monotonic() - began_s
        assert await phone.evaluate("isSecureContext")
        await expect(phone.locator(STICK)).to_have_attribute("data-phase", "idle")
        await drive(phone)
        async with asyncio.timeout(30):
            while not await asyncio.to_thread(moved_by, data, NAME):  # noqa: ASYNC110
                await asyncio.sleep(0.1)
    record_property("seconds to trust once", round(trusted_s, 1))
    record_property("seconds from scanning to driving", round(took_s, 1))
    record_property("taps", taps)
    assert took_s < LONGEST_S
    assert taps <= MOST_TAPS

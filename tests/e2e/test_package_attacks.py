"""Packages that are made to do harm, as a person at the dashboard meets them."""

import http.client
import json
import time
from contextlib import AsyncExitStack, closing
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple
from urllib.parse import urlsplit

import pytest
from anyio import to_thread
from playwright.async_api import FilePayload, expect

from bench.rig.programs import Robots
from tests.e2e.conftest import PageMaker
from tests.e2e.managing import running_managed
from tests.unit.packages.made import DOCUMENTS, package, write_package
from urc.packages.sources import make_bundle
from urc.packages.store import Store
from urc.testing.entry import HERE_COOKIE

pytestmark = pytest.mark.anyio
ATTACKS = Path(__file__).parents[1] / "attacks"
SAMPLES = 100
DISTURBED_MS = 20
"""Delay by the machine, in milliseconds, after which the wait for an answer does not count."""


async def test_what_a_package_uses_by_itself_needs_a_tick(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """It stands first; without the tick there is no way to install it."""
    async with running_managed(tmp_path) as address:
        page = await new_page(size="tablet")
        await page.goto(f"{address}interfaces")
        await page.get_by_label("Add by path").fill(str(ATTACKS / "drivers" / "key-user"))
        await page.get_by_role("button", name="Add", exact=True).click()
        dialog = page.get_by_role("dialog")
        risks = dialog.locator("[data-risks] li")
        await expect(risks.nth(0)).to_contain_text("uses a key file of this machine")
        install = dialog.get_by_role("button", name="Install")
        await expect(install).to_be_disabled()
        await dialog.get_by_label("Allow it").check()
        await install.click()
        await expect(dialog).to_contain_text("✓ installed")
        (lock,) = Store(tmp_path / "packages").installed()
        assert str(lock) == "drivers/key-user 1.0.0"


async def test_an_unsigned_upload_is_refused_until_each_package_is_accepted_by_name(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """The page names the packages without a signature, and offers one waiver for each."""
    bot = package("driver", "bot", needs={"widgets/dial": "*"})
    dial = package("widget", "dial")
    bundle = make_bundle(
        bot.manifest.key, {one.digest: one.data for one in (bot, dial)}, {}, "bundle"
    )
    upload: FilePayload = {"name": "bot.urcof", "mimeType": "application/zip", "buffer": bundle}
    async with running_managed(tmp_path) as address:
        page = await new_page(size="tablet")
        await page.goto(f"{address}interfaces")
        await page.get_by_label("Or a file on this device").set_input_files(upload)
        await page.get_by_role("button", name="Upload").click()
        dialog = page.get_by_role("dialog")
        await expect(dialog.get_by_text("Refused: not signed")).to_be_visible()
        install = dialog.get_by_role("button", name="Install")
        await expect(install).to_be_disabled()
        await dialog.get_by_label("Accept drivers/bot without a signature").check()
        await expect(install).to_be_disabled()
        await dialog.get_by_label("Accept widgets/dial without a signature").check()
        await install.click()
        await expect(dialog).to_contain_text("✓ installed")
    (lock,) = Store(tmp_path / "packages").installed()
    assert str(lock) == "drivers/bot 1.0.0"


class Wait(NamedTuple):
    """The wait for one answer, by the monotonic clock in nanoseconds."""

    began_ns: int
    ended_ns: int

    @property
    def took_s(self) -> float:
        """How long it took, in seconds."""
        return (self.ended_ns - self.began_ns) / 1e9

    def is_disturbed(self, witness: Robots) -> bool:
        """Return whether the machine kept an idle program from running."""
        return witness.latest_ms(self.began_ns, self.ended_ns) > DISTURBED_MS


class Asker:
    """A program that asks a dashboard, one request after the other on one connection."""

    def __init__(self, address: str) -> None:
        self._origin = address.rstrip("/")
        self._line = http.client.HTTPConnection(urlsplit(address).netloc, timeout=60)

    def ask(self, path: str, body: object = None) -> Any:
        """Return what is answered."""
        headers = {"origin": self._origin, "cookie": HERE_COOKIE}
        if body is None:
            self._line.request("GET", path, headers=headers)
        else:
            headers["content-type"] = "application/json"
            self._line.request("POST", path, json.dumps(body), headers)
        return json.loads(self._line.getresponse().read())

    def close(self) -> None:
        """Hang up."""
        self._line.close()

    def waited(self) -> Wait:
        """Ask the server whether it is well."""
        began_ns = time.monotonic_ns()
        assert self.ask("/healthz")["status"] == "ok"
        return Wait(began_ns, time.monotonic_ns())

    def examined(self, folder: Path) -> list[Wait]:
        """Have a package looked at; return the waits for answers meanwhile."""
        waits = []
        said = self.ask("/api/v1/packages/add", {"path": str(folder)})
        assert "number" in said, said
        while True:
            waits.append(self.waited())
            job = self.ask("/api/v1/packages?kinds=interface")["job"]
            if job["state"] != "working":
                self.ask("/api/v1/job/cancel", {"number": job["number"]})
                return waits


@pytest.mark.alone
async def test_the_dashboard_answers_while_packages_are_examined(tmp_path: Path) -> None:
    """Answers come as they do at rest: whatever a package costs, another process pays.

    At rest and meanwhile are measured in the same run. Answers that the machine itself has delayed
    do not count, because other programs may start in between.
    """
    many = "".join(
        f"  m{place}: {{ regex: '(?:a?){{160}}x{place}(?P<battery>\\d+)$' }}\n"
        for place in range(490)
    )
    costly = write_package(tmp_path / "shop", "driver", "costly", text=DOCUMENTS["driver"] + many)
    folders = [*sorted(one.parent for one in ATTACKS.glob("drivers/*/package.yaml")), costly]
    async with running_managed(tmp_path / "data") as address, AsyncExitStack() as stack:
        asker = stack.enter_context(closing(Asker(address)))
        witness = stack.enter_context(Robots([]))
        at_rest = await to_thread.run_sync(lambda: [asker.waited() for _ in range(SAMPLES)])
        examined: list[Wait] = []
        for folder in folders:
            examined += await to_thread.run_sync(asker.examined, folder)
        rest, meanwhile = (
            [one.took_s for one in waits if not one.is_disturbed(witness)]
            for waits in (at_rest, examined)
        )
    assert rest, "this machine is too busy"
    late = [wait for wait in meanwhile if wait > max(rest) + 0.05]
    figures = f"at rest {_told(rest)}, meanwhile {_told(meanwhile)}, late {len(late)}"
    assert len(meanwhile) > SAMPLES
    assert len(late) <= len(meanwhile) // 50, figures
    assert max(meanwhile) < 2, figures


def _told(waits: list[float]) -> str:
    return f"{1000 * median(waits):.1f} ms, at most {1000 * max(waits):.0f} ms of {len(waits)}"

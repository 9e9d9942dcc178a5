"""WebKit as a window of a virtual screen, driven by WebDriver through Debian's WebKitGTK."""

import os
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, cast

from selenium.common.exceptions import WebDriverException
from selenium.webdriver import Remote, WebKitGTKOptions, WebKitGTKService
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.remote.client_config import ClientConfig
from selenium.webdriver.remote.remote_connection import RemoteConnection

from scripts.needs import NEEDS
from tests.e2e.browsers.window import Window

__all__ = ["webkit_window"]

SCREEN = "1600x1200x24"
ANSWER_S = 70
"""Above the limit of a script or a page, whose message says more."""
SCRIPT_S = 60
AGAIN_S = 20
"""Time after which a page is loaded again, once: WebKit can miss its first load when busy."""
WATCH_S = 3
END_S = 10
_DRIVER, _XVFB = (
    next(need for need in NEEDS if need.name == name) for name in ("webkit-driver", "xvfb")
)
# Runs an expression, and waits for its promise.
_EVALUATE = """
const [done] = [...arguments].slice(-1);
Promise.resolve().then(() => (EXPRESSION)).then(
  (value) => done({ value }), (error) => done({ error: String(error) }));
"""
# WebKit gives a driver no console, and no script before those of a page. So this collects what a
# page says from the end of its modules on. A module that fails earlier leaves the page without
# values.
_WATCH = """
if (!window.urcFaults) {
  const faults = (window.urcFaults = []);
  const told = console.error;
  console.error = (...words) => (faults.push(`console: ${words.join(" ")}`), told(...words));
  const listen = (kind, words) => addEventListener(kind, (one) => faults.push(words(one)), true);
  listen("error", ({ message, target, error }) =>
    `error: ${message ?? target.outerHTML} ${error?.stack ?? ""}`);
  listen("unhandledrejection", ({ reason }) => `rejection: ${reason?.stack ?? reason}`);
  listen("securitypolicyviolation", (one) =>
    `CSP violation: ${one.violatedDirective} blocked ${one.blockedURI}`);
}
return document.readyState;
"""
# The same pages as in a container: without a GPU, and without the sandbox that root cannot use.
_ENVIRONMENT = {"GDK_BACKEND": "x11", "WEBKIT_DISABLE_SANDBOX_THIS_IS_DANGEROUS": "1"}


class WebKitWindow(Window):
    """The one window of a WebKit."""

    name = "WebKit"

    def __init__(self, driver: Remote) -> None:
        self._driver = driver
        self._faults: list[str] = []
        """Faults of the pages that it has left."""
        self.version = str(driver.capabilities["browserVersion"])

    def goto(self, address: str) -> None:
        self._faults = self.faults()
        self._driver.get(address)  # waits for the modules only: the page has yet to be watched
        start_s, is_again = time.monotonic(), False
        self._driver.set_script_timeout(WATCH_S)
        while self._watch() != "complete":
            waited_s = time.monotonic() - start_s
            assert waited_s < SCRIPT_S, f"WebKit: {address}: not loaded in {SCRIPT_S} s"
            if waited_s > AGAIN_S and not is_again:
                is_again = True
                self._driver.get(address)
        self._driver.set_script_timeout(SCRIPT_S)

    def evaluate(self, expression: str) -> Any:
        script = _EVALUATE.replace("EXPRESSION", expression)
        answer = self._driver.execute_async_script(script)
        if "error" in answer:
            raise AssertionError(f"WebKit: {expression}: {answer['error']}")
        return answer.get("value")

    def press(self, x: float, y: float) -> None:
        actions = self._actions()
        actions.pointer_action.move_to_location(round(x), round(y)).pointer_down()
        actions.perform()

    def move(self, x: float, y: float) -> None:
        actions = self._actions()
        actions.pointer_action.move_to_location(round(x), round(y))
        actions.perform()

    def release(self) -> None:
        actions = self._actions()
        actions.pointer_action.pointer_up()
        actions.perform()

    def resize(self, width: int, height: int) -> tuple[int, int]:
        self._driver.set_window_size(width, height)
        inner = self._driver.execute_script("return innerHeight")
        self._driver.set_window_size(width, height + height - inner)  # and its own bars
        wide, high = self._driver.execute_script("return [innerWidth, innerHeight]")
        return wide, high

    def screenshot(self, file: Path) -> None:
        file.write_bytes(self._driver.get_screenshot_as_png())

    def faults(self) -> list[str]:
        return self._faults + self._driver.execute_script("return window.urcFaults ?? []")

    def _watch(self) -> str:
        try:
            return str(self._driver.execute_script(_WATCH))
        except WebDriverException:  # WebKit forgets a script that starts just as the page changes
            return ""

    def _actions(self) -> ActionBuilder:
        return ActionBuilder(self._driver, duration=0)


@contextmanager
def webkit_window() -> Iterator[Window]:
    """Start a virtual screen and a WebKit in it; both end with the block."""
    driver = _DRIVER.find() or "WebKitWebDriver"
    # The browser's processes may write to their caches a little longer than the driver runs.
    home = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
    with home as folder, _screen() as display:
        options = WebKitGTKOptions()
        options.add_argument("--automation")
        options.page_load_strategy = "eager"
        options.binary_location = str(_mini_browser())
        environment = os.environ | _ENVIRONMENT | {"DISPLAY": display, "HOME": folder}
        service = WebKitGTKService(driver, env=environment)
        service.start()
        try:
            config = ClientConfig(service.service_url, timeout=ANSWER_S)
            started = Remote(RemoteConnection(client_config=config), options=options)
            try:
                started.set_script_timeout(SCRIPT_S)
                started.set_page_load_timeout(SCRIPT_S)
                yield WebKitWindow(started)
            finally:
                started.quit()
        finally:
            service.stop()


def _mini_browser() -> Path:
    """Return WebKitGTK's own browser, in the folder of its library."""
    found = sorted(Path("/usr/lib").glob("*/webkit2gtk-4.*/MiniBrowser"))
    assert found, "no MiniBrowser of WebKitGTK"
    return found[-1]


@contextmanager
def _screen() -> Iterator[str]:
    command = [_XVFB.find() or "Xvfb", "-displayfd", "1", "-screen", "0", SCREEN]
    process = subprocess.Popen(
        [*command, "-nolisten", "tcp"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    try:
        number = int(cast("IO[bytes]", process.stdout).readline())
        yield f":{number}"
    finally:
        process.terminate()
        process.wait(END_S)
        cast("IO[bytes]", process.stdout).close()

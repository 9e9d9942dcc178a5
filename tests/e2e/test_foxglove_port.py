"""The port of its own for Foxglove viewers: live robots, and the playback of a recording."""

import json
import socket
import ssl
from collections.abc import Callable
from pathlib import Path

import httpx2
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from tests.e2e.api_server import CART
from tests.e2e.command_line import PUPPET, at, run
from tests.e2e.foxglove_viewer import Viewer
from tests.e2e.ports import free_port
from tests.e2e.processes import UrcProcess

pytestmark = [pytest.mark.needs("node"), pytest.mark.needs("ws-protocol")]

Start = Callable[..., UrcProcess]
SDK = "foxglove.sdk.v1"


def printed(process: UrcProcess) -> str:
    """Return the address for viewers that a process printed."""
    return process.wait_for(r"foxglove (ws://127\.0\.0\.1:\d+/\?token=\S+)$")[1]


def cart(urc_process: Start, folder: Path, *more: str) -> UrcProcess:
    file = folder / "cart.yaml"
    file.write_text(CART, "utf-8")
    data = str(folder / "data")
    return urc_process(
        "serve",
        str(file),
        "--simulate",
        "--port",
        "0",
        "--data-dir",
        data,
        "--foxglove",
        "0",
        *more,
    )


def test_the_printed_address_opens_a_viewer(urc_process: Start, tmp_path: Path) -> None:
    with Viewer(printed(cart(urc_process, tmp_path)), SDK) as viewer:
        while "/cart/echo" not in viewer.services:
            viewer.next()
        battery = viewer.subscribe("/cart/battery")
        assert viewer.until("message", subscription=battery)["value"]["value"] >= 40
        assert viewer.call("/cart/echo", 1, word="hello")["value"] == {"word": "hello"}


def test_the_port_has_the_sign_in_of_the_dashboard(urc_process: Start, tmp_path: Path) -> None:
    """No token, no data: not for a program, not for a page of another site, not on loopback."""
    address = printed(cart(urc_process, tmp_path))
    bare = address.partition("?")[0]
    subprotocols = [Subprotocol(SDK)]
    for origin in (None, "https://viewer.example"):
        headers = {} if origin is None else {"origin": origin}
        with pytest.raises(InvalidStatus) as caught:
            connect(bare, subprotocols=subprotocols, proxy=None, additional_headers=headers)
        assert caught.value.response.status_code == 403
    with connect(f"{bare}?token=wrong", subprotocols=subprotocols, proxy=None) as line:
        said = json.loads(line.recv(10))
        assert (said["op"], said["level"]) == ("status", 2)
        assert "sign in" in said["message"]


def test_the_port_serves_no_pages(urc_process: Start, tmp_path: Path) -> None:
    address = printed(cart(urc_process, tmp_path)).replace("ws://", "http://").partition("?")[0]
    for path in ("", "healthz", "api/v1/robots", "static/core/app.css"):
        answer = httpx2.get(address + path, trust_env=False)
        assert answer.status_code == 426
        assert "Foxglove" in answer.text
        assert "default-src 'none'" in answer.headers["content-security-policy"]


def test_the_port_has_the_certificate_of_the_dashboard(urc_process: Start, tmp_path: Path) -> None:
    process = cart(urc_process, tmp_path, "--tls", "auto")
    address = process.wait_for(r"foxglove (wss://127\.0\.0\.1:\d+/\?token=\S+)$")[1]
    (authority,) = (tmp_path / "data").rglob("authority.pem")
    trusted = ssl.create_default_context(cafile=authority)
    with connect(
        address, subprotocols=[Subprotocol(SDK)], proxy=None, ssl=trusted, close_timeout=1
    ) as line:
        assert json.loads(line.recv(10))["op"] == "serverInfo"


def test_a_port_in_use_is_named_with_its_option(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        done = run("serve", PUPPET, "--simulate", "--port", "0", "--foxglove", port)
    assert done.returncode == 1
    assert f"port {port}: " in done.stderr
    assert done.stderr.strip().endswith("choose another port with --foxglove")


def test_a_recording_is_played_to_a_viewer(urc_process: Start, tmp_path: Path) -> None:
    file, port = tmp_path / "puppet.mcap", free_port()
    urc_process("simulate", PUPPET, "--set", f"port={port}").wait_for("listening")
    done = run("record", PUPPET, *at(port), "--for", "2500ms", "-o", str(file))
    assert done.returncode == 0, done.stderr
    replay = urc_process("replay", str(file), "--loop", "--port", "0", "--foxglove", "0")
    with Viewer(printed(replay), SDK) as viewer:
        while "/puppet/battery" not in viewer.channels:
            viewer.next()
        battery = viewer.subscribe("/puppet/battery")
        link = viewer.subscribe("/puppet/urc/link/wire")
        assert 0 <= viewer.until("message", subscription=battery)["value"]["value"] <= 100
        while viewer.until("message", subscription=link)["value"]["state"] != "live":
            pass
        assert viewer.services == {}, "nothing can be sent to a recording"

"""The maintainer's hook: one call for many alarms, bounded in time and number, no secrets."""

import json
import logging
import sys
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any, ClassVar

import pytest

from urc.alarms.alarm_list import AlarmActor
from urc.model.driver import Driver
from urc.model.values import AlarmAttributes, AlarmLimits, Sample, Signal
from urc.problems import ProblemsError
from urc.runtime.hub import Hub
from urc.runtime.robot_alarms import RobotAlarms
from urc.testing.clock import FakeClock
from urc.web.alarms import notifier as notifier_module
from urc.web.alarms.notifier import AlarmNotifier
from urc.web.alarms.notify_options import NotifyOptions, read_notify_options

FAN = AlarmAttributes("low")
LOW = AlarmAttributes("high", "It is used.", "Dock.")
BATTERY = Signal(
    "battery", title="Battery", unit="%", limits=AlarmLimits(low=20, attributes=(("low", LOW),))
)
SIGNALS = {
    "battery": BATTERY,
    "heat": Signal("heat", limits=AlarmLimits(high=70)),
    "fan": Signal("fan", limits=AlarmLimits(high=1, attributes=(("high", FAN),))),
    **{f"s{at}": Signal(f"s{at}", limits=AlarmLimits(high=1)) for at in range(200)},
}
ADA = AlarmActor("Ada")
SAVE = (
    "import sys, pathlib;"
    " pathlib.Path(sys.argv[1]).open('ab').write(sys.stdin.buffer.read() + bytes([10]))"
)


@pytest.fixture(autouse=True)
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is collected for a second, and nothing is tried again later."""
    monkeypatch.setattr(notifier_module, "GATHER_S", 0.01)
    monkeypatch.setattr(notifier_module, "_WAITS_S", (0.01,) * 4)


class Robot:
    """A robot whose alarms are notified."""

    def __init__(self, options: NotifyOptions) -> None:
        self.notifier = AlarmNotifier(options)
        self.hub = Hub(SIGNALS)
        self.alarms = RobotAlarms(Driver(signals=SIGNALS), FakeClock(), time.time)
        self.alarms.on_events = lambda events: self.notifier.queue(
            "rover", "Rover", self.alarms, events
        )
        self.attending = self.alarms.attending(self.hub)
        self.attending.__enter__()

    def publish(self, name: str, value: float, alarm: str = "") -> None:
        self.hub.publish([Sample(name, value, 0.0, alarm)])  # type: ignore[arg-type]

    def close(self) -> None:
        self.attending.__exit__(None, None, None)
        self.notifier.close()


def told(file: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in file.read_text().splitlines()]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "told"


@pytest.fixture
def robot(file: Path) -> Iterator[Robot]:
    made = Robot(NotifyOptions(command=(sys.executable, "-c", SAVE, str(file))))
    yield made
    made.close()


def test_a_command_gets_a_new_alarm_with_its_action(robot: Robot, file: Path) -> None:
    robot.publish("battery", 15, "low")
    assert robot.notifier.settle(10)
    (news,) = told(file)
    (alarm,) = news.pop("alarms")
    assert abs(news.pop("time") - time.time()) < 60
    assert news == {"robot": "rover", "title": "Rover", "flood": False, "more": 0}
    assert abs(alarm.pop("at") - time.time()) < 60
    assert alarm == {
        "kind": "raised", "signal": "battery", "title": "Battery", "condition": "low",
        "priority": "high", "value": "15", "unit": "%", "cause": "It is used.", "action": "Dock.",
    }  # fmt: skip
    assert robot.notifier.count == (1, 0, 0)


def test_only_what_operators_must_see_is_notified(robot: Robot, file: Path) -> None:
    robot.publish("fan", 2, "high")  # of low priority
    robot.publish("heat", 75, "high")
    robot.alarms.shelve(["heat"], 60, ADA)
    assert robot.notifier.settle(10)
    robot.publish("heat", 60)
    robot.publish("heat", 75, "high")  # shelved
    robot.publish("battery", 15, "low")
    robot.publish("battery", 60)  # returned to normal
    assert robot.notifier.settle(10)
    found = [(one["signal"], one["kind"]) for news in told(file) for one in news["alarms"]]
    assert found == [("heat", "raised"), ("battery", "raised")]


def test_returns_are_notified_on_request(file: Path) -> None:
    command = (sys.executable, "-c", SAVE, str(file))
    robot = Robot(NotifyOptions(command=command, has_returned=True, priority="low"))
    robot.publish("fan", 2, "high")
    robot.publish("fan", 0)
    assert robot.notifier.settle(10)
    found = [(one["signal"], one["kind"]) for news in told(file) for one in news["alarms"]]
    assert found == [("fan", "raised"), ("fan", "returned")]
    robot.close()


def test_a_flood_is_one_notification(robot: Robot, file: Path) -> None:
    with robot.notifier._wakes:  # so that the thread sees no part of the flood
        for at in range(200):
            robot.publish(f"s{at}", 2, "high")
    assert robot.notifier.settle(30)
    first, *rest = told(file)
    assert rest == []
    assert first["flood"]
    assert (len(first["alarms"]), first["more"] > 0) == (50, True)


def test_what_waits_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(notifier_module, "MOST_WAITING", 10)
    monkeypatch.setattr(notifier_module, "GATHER_S", 1.0)
    robot = Robot(NotifyOptions(command=("true",)))
    began = time.monotonic()
    for at in range(100):
        robot.publish(f"s{at}", 2, "high")
    assert time.monotonic() - began < 0.5, "nothing waits for the hook"
    assert robot.notifier.count.lost == 90
    robot.close()


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (("false",), "exit code 1"),
        (("/does/not/exist",), "No such file"),
        (("sh", "-c", "sleep 60 & wait"), "did not finish within 1 s"),
    ],
)
def test_a_command_that_fails_is_tried_again_logged_and_counted(
    command: tuple[str, ...], reason: str, caplog: pytest.LogCaptureFixture
) -> None:
    robot = Robot(NotifyOptions(command=command, timeout_s=1.0, tries=2))
    robot.publish("battery", 15, "low")
    assert robot.notifier.settle(10)
    assert robot.notifier.count == (0, 1, 0)
    assert caplog.text.count(reason) == 2
    robot.close()


class Hook(BaseHTTPRequestHandler):
    """A webhook."""

    got: ClassVar[list[tuple[str, str | None, dict[str, Any]]]] = []
    status = 204

    def do_POST(self) -> None:
        data = self.rfile.read(int(self.headers["content-length"]))
        self.got.append((self.path, self.headers["authorization"], json.loads(data)))
        self.send_response(self.status)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@pytest.fixture
def hook() -> Iterator[str]:
    Hook.got, Hook.status = [], 204
    server = HTTPServer(("127.0.0.1", 0), Hook)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}/hooks/s3cret-path"
    server.shutdown()
    server.server_close()


def test_a_url_gets_a_post_with_its_secret(hook: str) -> None:
    robot = Robot(NotifyOptions(url=hook, secret="open sesame"))  # noqa: S106 - of a test
    robot.publish("battery", 15, "low")
    assert robot.notifier.settle(10)
    ((path, authorization, news),) = Hook.got
    assert (path, authorization) == ("/hooks/s3cret-path", "Bearer open sesame")
    assert news["alarms"][0]["signal"] == "battery"
    assert robot.notifier.count == (1, 0, 0)
    robot.close()


def test_secrets_of_a_url_are_in_no_log(hook: str, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    Hook.status = 500
    options = NotifyOptions(url=hook, secret="open sesame", tries=1)  # noqa: S106 - of a test
    robot = Robot(options)
    robot.publish("battery", 15, "low")
    assert robot.notifier.settle(10)
    robot.close()
    gone = Robot(NotifyOptions(url="http://127.0.0.1:9/s3cret", tries=1, secret="open sesame"))  # noqa: S106
    gone.publish("battery", 15, "low")
    assert gone.notifier.settle(10)
    gone.close()
    assert caplog.text.count("the alarm notification for rover failed: http://127.0.0.1:") == 2
    assert "status 500" in caplog.text
    for secret in ("s3cret", "open sesame"):
        assert secret not in caplog.text
        assert secret not in repr(options)


def options(folder: Path, text: str) -> NotifyOptions:
    (folder / "notify.yaml").write_text(text)
    return read_notify_options(str(folder / "notify.yaml"))


def test_the_file_is_read(tmp_path: Path) -> None:
    found = options(tmp_path, "command: [page-me, --robot]\npriority: high\nreturned: true\n")
    assert found == NotifyOptions(("page-me", "--robot"), priority="high", has_returned=True)
    for name, content in (("url", "https://hooks.example/T0/s3cret\n"), ("token", "open sesame")):
        (tmp_path / name).write_text(content)
        (tmp_path / name).chmod(0o600)
    found = options(tmp_path, "url_file: url\nsecret_file: token\ntimeout_s: 5\ntries: 1\n")
    assert (found.url, found.secret) == ("https://hooks.example/T0/s3cret", "open sesame")
    assert (found.timeout_s, found.tries, found.place) == (5.0, 1, "https://hooks.example")


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("priority: high\n", "expected exactly one of command, url and url_file"),
        ("command: [a]\nurl: https://x.example\n", "expected exactly one of"),
        ("command: page-me\n", "expected a list"),
        ("command: []\n", "expected a list of 1 to 50 strings"),
        ("command: [a, 3]\n", "expected a list of 1 to 50 strings"),
        ("url: ftp://x.example\n", "expected a URL"),
        ("url: http://x.example/a\n", "expected https:"),
        ("url: https://me:pass@x.example/a\n", "expected a URL"),
        ("url_file: missing\n", "cannot be read"),
        ("url_file: open\n", "all users of this machine can access"),
        ("command: [a]\nsecret_file: token\n", "'secret_file' needs a URL"),
        ("command: [a]\npriority: urgent\n", "expected low, medium or high"),
        ("command: [a]\nreturned: maybe\n", "expected true or false"),
        ("command: [a]\ntimeout_s: 0\n", "expected a number from 1 to 60"),
        ("command: [a]\ntries: 9\n", "expected a number from 1 to 5"),
        ("command: [a]\nwhen: now\n", "unknown key 'when'"),
    ],
)
def test_a_mistake_has_a_place(tmp_path: Path, text: str, fault: str) -> None:
    (tmp_path / "open").write_text("https://hooks.example/s3cret")
    (tmp_path / "open").chmod(0o644)
    with pytest.raises(ProblemsError) as raised:
        options(tmp_path, text)
    assert fault in str(raised.value)
    assert "s3cret" not in str(raised.value)

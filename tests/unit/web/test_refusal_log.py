"""A site that is refused again and again fills no log."""

import pytest

from urc.web.sites import refusal_log
from urc.web.sites.refusal_log import RefusalLog


def test_the_same_refusal_is_logged_once_a_minute(caplog: pytest.LogCaptureFixture) -> None:
    times_s = iter((0.0, 1.0, 59.9, 60.0, 61.0))
    told = RefusalLog(lambda: next(times_s))
    for _ in range(5):
        told.tell("a line", "zug", "it is revoked")
    assert [one.getMessage() for one in caplog.records] == [
        "a line of the site zug is refused: it is revoked"
    ] * 2


def test_each_reason_site_and_thing_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    told = RefusalLog(lambda: 0.0)
    for what, site, reason in (
        ("a line", "zug", "it is revoked"),
        ("a line", "zug", "it has ended"),
        ("a line", "chur", "it is revoked"),
        ("a visitor", "zug", "it is revoked"),
    ):
        told.tell(what, site, reason)
    assert len(caplog.records) == 4


def test_a_claimed_name_cannot_forge_a_line(caplog: pytest.LogCaptureFixture) -> None:
    RefusalLog(lambda: 0.0).tell("a line", "zug\nurc: all is well", "it is revoked")
    assert "\n" not in caplog.records[0].getMessage()


def test_many_claimed_names_need_little_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(refusal_log.log, "warning", lambda *_: None)
    told = RefusalLog(lambda: 0.0)
    for number in range(10_000):
        told.tell("a line", f"zug-{number}", "it is revoked")
    assert len(told._told) <= 256

"""docs/urc.service: a service with a user of its own, and no rights on the system."""

from collections import defaultdict
from pathlib import Path

import pytest

from urc.cli.main import VERBS
from urc.guard import real_time_priority

ROOT = Path(__file__).resolve().parents[2]
SETTINGS: dict[str, list[str]] = defaultdict(list)
for line in (ROOT / "docs/urc.service").read_text("utf-8").splitlines():
    key, _, value = line.partition("=")
    if value or line.endswith("="):
        SETTINGS[key].append(value)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("DynamicUser", "yes"),
        ("NoNewPrivileges", "yes"),
        ("ProtectSystem", "strict"),
        ("ProtectHome", "yes"),
        ("PrivateTmp", "yes"),
        ("CapabilityBoundingSet", ""),
        ("StateDirectoryMode", "0700"),
        ("UMask", "0077"),
        ("RestrictSUIDSGID", "yes"),
    ],
)
def test_the_service_has_no_rights_on_the_system(key: str, value: str) -> None:
    assert SETTINGS[key] == [value]
    assert "User" not in SETTINGS


def test_the_service_writes_only_its_own_data() -> None:
    """The data folder is the one folder that systemd makes for the service."""
    (state,) = SETTINGS["StateDirectory"]
    assert SETTINGS["Environment"] == [f"URC_DATA_DIR=/var/lib/{state}"]
    assert "ReadWritePaths" not in SETTINGS


def test_the_service_starts_a_command_that_exists_on_loopback() -> None:
    """Other addresses are a step that people take."""
    (command,) = SETTINGS["ExecStart"]
    words = command.split()
    assert words[0].endswith("/urc")
    assert words[1] in VERBS
    assert "--host" not in words


def test_the_start_key_is_not_written_to_the_journal() -> None:
    """URC prints its address with the key on standard output, and problems on standard error."""
    assert SETTINGS["StandardOutput"] == ["null"]
    assert SETTINGS["StandardError"] == ["journal"]


def test_the_guard_may_run_before_other_programs() -> None:
    (most,) = SETTINGS["LimitRTPRIO"]
    assert int(most) >= real_time_priority._PRIORITY
    assert "RestrictRealtime" not in SETTINGS

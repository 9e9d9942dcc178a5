"""Where URC keeps its own data."""

import sys
from pathlib import Path
from tempfile import gettempdir

import pytest

from urc._folders import data_folder


def test_tests_use_no_data_of_their_user() -> None:
    """Otherwise a test could reset the STOP of a real robot."""
    assert data_folder().is_relative_to(gettempdir())


def test_named_folder_wins() -> None:
    """For services, tests, and a second robot lab on one machine."""
    assert data_folder({"URC_DATA_DIR": "/srv/urc", "XDG_DATA_HOME": "/x"}) == Path("/srv/urc")
    assert data_folder({"URC_DATA_DIR": "~/urc"}) == Path.home() / "urc"


@pytest.mark.parametrize(
    ("platform", "environ", "folder"),
    [
        ("linux", {}, Path.home() / ".local/share/urc"),
        ("linux", {"XDG_DATA_HOME": "/x"}, Path("/x/urc")),
        ("darwin", {}, Path.home() / "Library/Application Support/urc"),
        ("win32", {"LOCALAPPDATA": "/appdata"}, Path("/appdata/urc")),
    ],
)
def test_each_system_has_its_place(
    monkeypatch: pytest.MonkeyPatch, platform: str, environ: dict[str, str], folder: Path
) -> None:
    """As its users expect."""
    monkeypatch.setattr(sys, "platform", platform)
    assert data_folder(environ) == folder

"""What makes thousands of small tests quick: nothing is waited for, nothing made again and again.

Whether a file survives a power cut can't be seen here; the tests that end a process at any moment,
or fill the disk, put their own function in the place of ``os.fsync``.
"""

import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import argon2
import pytest

from urc.access import passphrases
from urc.config.parse.widget import WidgetFolder
from urc.model.widget import Widget
from urc.shipped import shipped
from urc.web.load import file_routes


def seen_to_be_open(number: int) -> None:
    """Refuse what ``os.fsync`` would refuse."""
    os.fstat(number)


@pytest.fixture(scope="session", autouse=True)
def never_wait_for_the_disk() -> Iterator[None]:
    """Let ``os.fsync`` only see that the file is open: three thousand of them take seconds."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("os.fsync", seen_to_be_open)
        yield


@pytest.fixture(scope="session", autouse=True)
def hash_passphrases_quickly() -> Iterator[None]:
    """Hash with the least that argon2 allows: its full price is a tenth of a second for each."""
    hasher = argon2.PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(passphrases, "_HASHER", hasher)
        patched.setattr(passphrases, "_NEVER", hasher.hash("no passphrase"))
        yield


def read_shipped_widgets_once() -> None:
    """Keep each good manifest that ships; every robot's default look asks for a dozen of them."""
    read, folder = WidgetFolder._read, shipped("widgets")
    known: dict[tuple[str, Path], Widget | None] = {}

    def once(self: WidgetFolder, name: str) -> Widget | None:
        place = (name, Path.cwd())  # findings name the file as seen from here
        if self.folder != folder:
            return read(self, name)
        if place not in known:
            told = len(self.problems)
            widget = read(self, name)
            if len(self.problems) != told:
                return widget
            known[place] = widget
        return known[place]

    WidgetFolder._read = once  # type: ignore[method-assign]


read_shipped_widgets_once()
# Each dashboard looks through the folders that ship. What is in them is still looked at when asked.
file_routes.folder_assets = cache(file_routes.folder_assets)  # type: ignore[attr-defined]

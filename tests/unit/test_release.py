"""The files of a release: same bytes from same contents, checksums that others can check."""

import json
import os
import shutil
import subprocess
import tarfile
import zipfile
from pathlib import Path
from typing import Any

import pytest

from scripts.debian_package import TEMPLATE, packaged_service
from scripts.release import ReleaseError, changes_of, notices, write_sums, write_tar

CHANGELOG = """\
# Changelog

## [Unreleased]

## [0.2.0] - 2026-12-01

- Second.

## [0.1.0]

- First.
"""
EPOCH = 1_700_000_000


@pytest.mark.parametrize(("version", "text"), [("0.2.0", "- Second."), ("0.1.0", "- First.")])
def test_changes_are_those_of_the_version(version: str, text: str) -> None:
    assert changes_of(CHANGELOG, version) == text


@pytest.mark.parametrize("version", ["Unreleased", "0.3.0", "0.1"])
def test_a_version_without_changes_is_not_released(version: str) -> None:
    with pytest.raises(ReleaseError, match=rf"no entries for \[{version}\]"):
        changes_of(CHANGELOG, version)


def test_an_archive_depends_on_names_contents_and_time_only(tmp_path: Path) -> None:
    file = tmp_path / "page.html"
    file.write_text("a page")
    write_tar(tmp_path / "first.tar.gz", [("docs/page.html", file)], EPOCH)
    os.utime(file, (1, 1))
    file.chmod(0o600)
    write_tar(tmp_path / "second.tar.gz", [("docs/page.html", file)], EPOCH)
    first = (tmp_path / "first.tar.gz").read_bytes()
    assert first == (tmp_path / "second.tar.gz").read_bytes()
    with tarfile.open(tmp_path / "first.tar.gz") as opened:
        (entry,) = opened.getmembers()
    assert (entry.name, entry.mtime, entry.uid, entry.mode) == ("docs/page.html", EPOCH, 0, 0o644)


@pytest.mark.skipif(shutil.which("sha256sum") is None, reason="not on this system")
def test_sha256sum_finds_a_changed_file_by_the_checksums(tmp_path: Path) -> None:
    (tmp_path / "completions").mkdir()
    (tmp_path / "completions" / "_urc").write_text("script")
    (tmp_path / "urc.whl").write_text("wheel")
    write_sums(tmp_path)
    command = ["sha256sum", "--check", "SHA256SUMS"]
    first = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert sorted(first.stdout.splitlines()) == ["completions/_urc: OK", "urc.whl: OK"]
    (tmp_path / "urc.whl").write_text("other")
    second = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert second.returncode != 0
    assert "urc.whl: FAILED" in second.stdout


def component(name: str, licence: str, *, is_bundled: bool) -> dict[str, Any]:
    properties = [{"name": "urc:bundled", "value": "true" if is_bundled else "false"}]
    return {
        "name": name, "version": "1.0", "licenses": [{"expression": licence}],
        "properties": properties,
    }  # fmt: skip


def wheel_with(folder: Path, **files: str) -> Path:
    """Write a wheel with one bundled module and one needed package."""
    parts = [
        component("chart", "ISC", is_bundled=True),
        component("jinja2", "BSD-3-Clause", is_bundled=False),
    ]
    with zipfile.ZipFile(folder / "urc.whl", "w") as made:
        made.writestr("urc.dist-info/sboms/urc.cdx.json", json.dumps({"components": parts}))
        for name, text in files.items():
            made.writestr(f"urc_vendor/chart/{name}", text)
    return folder / "urc.whl"


def test_notices_hold_the_licence_text_of_bundled_modules(tmp_path: Path) -> None:
    text = notices(wheel_with(tmp_path, LICENSE="Permission to use ..."))
    contained, _, needed = text.partition("An installation also needs")
    assert "chart 1.0: ISC" in contained
    assert "jinja2 1.0: BSD-3-Clause" in needed
    assert "Permission to use ..." in needed


def test_a_bundled_module_without_licence_text_is_not_released(tmp_path: Path) -> None:
    with pytest.raises(ReleaseError, match="no licence text for chart"):
        notices(wheel_with(tmp_path))


def test_the_packaged_service_starts_the_packaged_command() -> None:
    """Without the comment on the installation by hand."""
    lines = packaged_service().splitlines()
    assert lines[0] == "[Unit]"
    (command,) = [line for line in lines if line.startswith("ExecStart=")]
    assert command.startswith("ExecStart=/usr/bin/urc serve ")


def test_removing_the_package_stops_the_service_and_purging_it_deletes_the_data() -> None:
    """debhelper stops no service that it does not start, and `rules` tells it to start none."""
    rules, before, after = ((TEMPLATE / one).read_text() for one in ("rules", "prerm", "postrm"))
    assert "dh_installsystemd --no-enable --no-start" in rules
    assert 'if [ "$1" = remove ]' in before
    assert "deb-systemd-invoke stop urc.service" in before
    assert 'if [ "$1" = purge ]' in after
    assert "rm -rf /var/lib/private/urc\n" in after
    for name in ("prerm", "postrm"):
        assert "#DEBHELPER#" in (TEMPLATE / name).read_text()
        subprocess.run(["sh", "-n", TEMPLATE / name], check=True)

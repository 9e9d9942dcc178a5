"""Which dashboards run on this machine: a file each, of its owner alone."""

import os
import stat
import subprocess
from pathlib import Path

import pytest

from urc.runtime.running_servers import RunningServer, announced, headers, servers

MINE = RunningServer("http://127.0.0.1:8080/", "a-key", os.getpid())


def found(data: Path) -> list[RunningServer]:
    """Return the servers that are found."""
    return [*servers(data).values()]


def test_a_server_is_found_while_it_runs(tmp_path: Path) -> None:
    """By programs that use the same folder; before and after, none is."""
    assert found(tmp_path) == []
    with announced(tmp_path, "1a2b3c4d", MINE):
        assert found(tmp_path) == [MINE]
        assert headers(MINE) == {"authorization": "Bearer a-key"}
    assert found(tmp_path) == []
    assert list((tmp_path / "servers").iterdir()) == []


@pytest.mark.skipif(os.name != "posix", reason="other systems have other rights")
def test_only_its_owner_reads_the_key(tmp_path: Path) -> None:
    """Neither the file nor the folder is open to other users."""
    with announced(tmp_path, "1a2b3c4d", MINE):
        (file,) = (tmp_path / "servers").iterdir()
        assert stat.S_IMODE(file.stat().st_mode) == 0o600
        assert stat.S_IMODE(file.parent.stat().st_mode) == 0o700


@pytest.mark.skipif(os.name != "posix", reason="other systems cannot say it")
def test_a_server_that_was_killed_is_not_found_and_its_file_goes(tmp_path: Path) -> None:
    """The next one tidies up; what is no such file is no fault."""
    folder = tmp_path / "servers"
    gone = subprocess.Popen(["true"])
    gone.wait()
    dead = gone.pid
    with announced(tmp_path, "dead", MINE._replace(pid=dead)):
        (folder / "torn.json").write_text('{"address": ', "utf-8")
        (folder / "list.json").write_text("[1, 2]", "utf-8")
        with announced(tmp_path, "live", MINE):
            assert found(tmp_path) == [MINE]
            assert [file.name for file in folder.iterdir()] == ["live.json"]


def test_the_newest_comes_first(tmp_path: Path) -> None:
    """Two may use one folder."""
    other = MINE._replace(address="http://127.0.0.1:8081/")
    with announced(tmp_path, "old", MINE), announced(tmp_path, "new", other):
        os.utime(tmp_path / "servers" / "old.json", (1, 1))
        assert found(tmp_path) == [other, MINE]

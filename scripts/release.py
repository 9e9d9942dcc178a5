"""The command `./dev release`: build all files of a release, and check them.

    ./dev release                      everything, into dist/
    ./dev release --debian WHEELS      also the Debian package, from a folder of wheels

The command only builds files, and publishes nothing. Each build runs twice, in different folders;
the results must have the same bytes. All files carry the time of the last commit, so builds on
other machines produce the same bytes.
"""

import argparse
import gzip
import hashlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from scripts.publication import PAGE, missing_values
from urc import __version__

__all__ = ["NOTICES", "ReleaseError", "changes_of", "main", "notices", "write_sums"]

ROOT = Path(__file__).resolve().parents[1]
DIST = ROOT / "dist"
NOTICES = "THIRD-PARTY-NOTICES.txt"
SUMS = "SHA256SUMS"
SHELLS = {"bash": "urc", "zsh": "_urc", "fish": "urc.fish"}
"""File name of each shell's completion script, as the shell expects it."""
_BUILD_S = 600


class ReleaseError(Exception):
    """Raised if a release check fails; its message has only one line."""


def main(arguments: list[str] | None = None) -> int:
    """Build the release; return the exit code."""
    parser = argparse.ArgumentParser(prog="./dev release", description="Build a release.")
    parser.add_argument("--out", type=Path, default=DIST, metavar="FOLDER", help="default: dist/")
    parser.add_argument(
        "--debian", type=Path, metavar="WHEELS", help="folder of wheels for the Debian package"
    )
    options = parser.parse_args(arguments)
    try:
        release(options.out, options.debian)
    except ReleaseError as error:
        print(f"release: {error}", file=sys.stderr)
        return 1
    return 0


def release(out: Path, wheels: Path | None) -> None:
    """Build and check all files of the release in the folder `out`."""
    if shutil.which("git") is None:
        raise ReleaseError("git is missing: a release contains the files and the time of a commit")
    changes_of((ROOT / "CHANGELOG.md").read_text("utf-8"), __version__)
    epoch = commit_time()
    date = datetime.fromtimestamp(epoch, UTC).strftime("%Y-%m-%d")
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    say("wheel and sdist, twice")
    build_twice(out, epoch)
    (wheel,) = out.glob("*.whl")
    say("SBOM, notices, manual page, completions")
    check_sbom(wheel, out)
    (out / NOTICES).write_text(notices(wheel), "utf-8")
    from scripts.manual_page import manual_page

    (out / "urc.1").write_text(manual_page(date), "utf-8")
    write_completions(out / "completions")
    if find_spec("scripts.site") is not None:
        say("site")
        pack_site(out / f"urc-{__version__}-docs.tar.gz", epoch)
    if wheels is not None:
        say("Debian package")
        from scripts.debian_package import build_package

        build_package(out, wheels, epoch)
    write_sums(out)
    for file in sorted(path for path in out.rglob("*") if path.is_file()):
        print(f"{file.stat().st_size / 1e6:8.2f} MB  {file.relative_to(out)}")
    for line in missing_values(ROOT, __version__):
        print(f"to fill in before the first publication ({PAGE}): {line}")


def say(text: str) -> None:
    """Print the step that begins now to standard error."""
    print(f"release: {text} ...", file=sys.stderr, flush=True)


def changes_of(changelog: str, version: str) -> str:
    """Return a version's entries in the changelog.

    Raises:
        ReleaseError: the changelog has no section for the version.
    """
    found = re.search(
        rf"^## \[{re.escape(version)}\][^\n]*\n(.*?)(?=^## \[|\Z)", changelog, re.M | re.S
    )
    if found is None or not found[1].strip():
        raise ReleaseError(f"CHANGELOG.md has no entries for [{version}]")
    return found[1].strip()


def commit_time() -> int:
    """Return the last commit's time, or `SOURCE_DATE_EPOCH`, in seconds since the epoch."""
    if named := os.environ.get("SOURCE_DATE_EPOCH"):
        return int(named)
    command = ["git", "log", "-1", "--format=%ct"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ReleaseError("no git history: set SOURCE_DATE_EPOCH to the time of the release")
    return int(done.stdout)


def build_twice(out: Path, epoch: int) -> None:
    """Build the wheel and the sdist here and in a copy of the sources; compare the bytes."""
    build(ROOT, out, epoch)
    with TemporaryDirectory(prefix="urc-release-") as folder:
        copy, second = Path(folder, "elsewhere"), Path(folder, "dist")
        copy_sources(copy)
        build(copy, second, epoch)
        for file in sorted(second.iterdir()):
            if file.read_bytes() != (out / file.name).read_bytes():
                raise ReleaseError(f"{file.name} differs between two builds")


def copy_sources(target: Path) -> None:
    """Copy the checkout's files, except ignored files."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    for name in filter(None, done.stdout.split("\0")):
        if (ROOT / name).is_file():  # a deleted file may still be in the index
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target / name)


def build(source: Path, out: Path, epoch: int) -> None:
    """Build the wheel and the sdist from a folder with sources."""
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(out.absolute())]
    environment = os.environ | {"SOURCE_DATE_EPOCH": str(epoch)}
    done = subprocess.run(
        command, cwd=source, env=environment, capture_output=True, text=True, timeout=_BUILD_S,
        check=False,
    )  # fmt: skip
    if done.returncode != 0:
        raise ReleaseError(f"the build failed: {(done.stderr or done.stdout).strip()[-2000:]}")


def check_sbom(wheel: Path, out: Path) -> None:
    """Check the wheel's SBOM against the official schema, and write it next to the wheel."""
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator

    name = f"urc-{__version__}.dist-info/sboms/urc.cdx.json"
    with zipfile.ZipFile(wheel) as opened:
        text = opened.read(name).decode()
    if fault := JsonStrictValidator(SchemaVersion.V1_6).validate_str(text):
        raise ReleaseError(f"the SBOM is invalid: {fault}")
    (out / f"urc-{__version__}.cdx.json").write_text(text, "utf-8")


def notices(wheel: Path) -> str:
    """Return the licence notices of all packages that a wheel contains or needs."""
    with zipfile.ZipFile(wheel) as opened:
        names = opened.namelist()
        sbom = json.loads(opened.read(next(one for one in names if one.endswith("urc.cdx.json"))))
        texts = {
            one.split("/LICENSE")[0].removeprefix("urc_vendor/"): opened.read(one).decode()
            for one in names
            if re.fullmatch(r"urc_vendor/.+/LICENSE[^/]*", one)
        }
    parts = [f"Third-party software in URC {__version__}", ""]
    bundled: list[tuple[str, str]] = []
    needed: list[tuple[str, str]] = []
    for one in sbom["components"]:
        line = f"{one['name']} {one['version']}: {one['licenses'][0]['expression']}"
        is_bundled = {"name": "urc:bundled", "value": "true"} in one["properties"]
        (bundled if is_bundled else needed).append((one["name"], line))
    parts += ["The wheel contains these packages:", "", *(line for _, line in bundled), ""]
    parts += ["An installation also needs these packages, which are not in the wheel:", ""]
    parts += [*dict.fromkeys(line for _, line in needed), ""]
    for name, line in bundled:
        if name not in texts:
            raise ReleaseError(f"the wheel has no licence text for {name}")
        parts += ["-" * 72, line, "-" * 72, "", texts[name].strip(), ""]
    return "\n".join(parts)


def write_completions(folder: Path) -> None:
    """Write each shell's completion script."""
    from argcomplete.shell_integration import shellcode

    folder.mkdir()
    for shell, name in SHELLS.items():
        (folder / name).write_text(shellcode(["urc"], shell=shell).strip() + "\n", "utf-8")


def pack_site(target: Path, epoch: int) -> None:
    """Build the documentation site, and pack it into an archive."""
    site = import_module("scripts.site")  # not in every checkout
    if site.build() != 0:
        raise ReleaseError("the site could not be built")
    files = sorted(path for path in Path(site.HTML).rglob("*") if path.is_file())
    write_tar(target, ((path.relative_to(site.HTML).as_posix(), path) for path in files), epoch)


def write_tar(target: Path, files: Iterable[tuple[str, Path]], epoch: int) -> None:
    """Write a compressed archive whose bytes depend only on names, contents and time."""
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w") as archive:
        for name, path in files:
            entry = tarfile.TarInfo(name)
            entry.size, entry.mtime = path.stat().st_size, epoch
            with path.open("rb") as opened:
                archive.addfile(entry, opened)
    target.write_bytes(gzip.compress(buffer.getvalue(), mtime=epoch))


def write_sums(folder: Path) -> None:
    """Write the checksums of all files, in the format of ``sha256sum --check``."""
    (folder / SUMS).unlink(missing_ok=True)
    (folder / SUMS).write_text("".join(_sums(folder)), "utf-8")


def _sums(folder: Path) -> Iterator[str]:
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        yield f"{digest}  {path.relative_to(folder).as_posix()}\n"


if __name__ == "__main__":
    sys.exit(main())

"""Build the playground as one folder of static files: `python -m scripts.playground FOLDER`.

Any static web server can serve the folder, under any path. The playground's pages contact no other
hosts. The folder contains:

- the interpreter: Pyodide from npm, in the version from `package-lock.json`;
- `python.bin`: URC, its documents and templates, and the packages that they need, compiled, as a
  tar archive in gzip;
- `dash/`: the modules and styles of the dashboard and the widgets, at a server's paths;
- the page, its worker and its service worker, from `playground/static`;
- `licences/`: see `scripts.playground_licences`.

Packages are copied from this environment, which has the versions from `requirements/`. `msgspec` is
the only package with a browser build on the package index; pip checks its locked hash.
"""

import argparse
import gzip
import hashlib
import io
import json
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Iterable
from importlib.metadata import distribution
from pathlib import Path

from scripts.node import node_executable
from scripts.playground_licences import PACKAGES, write_licences
from urc.shipped import vendored

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "playground" / "static"
PYODIDE = ROOT / "node_modules" / "pyodide"
RUNTIME = ("pyodide.mjs", "pyodide.asm.mjs", "pyodide.asm.wasm")
COMPILED = ("msgspec",)
"""Packages with a browser build on the package index. The pure Python files of the other packages
are sufficient; `playground.stand_ins` replaces their other parts."""
ABI = "pyemscripten_2026_0_wasm32"
"""Platform of the browser builds for this version of Pyodide."""
PYTHON = "3.14"
DATA = ("schemas", "robots", "widgets", "templates")
SKIPPED = ("__pycache__", "tests", "test", "static", "cli/new_widget")
CACHE = ROOT / "build" / "playground"
"""Folder with an archive of the last build's bytecode, named after the sources' hash."""
WHEELS = CACHE / "wheels"
"""Downloaded browser builds; with them, a later build needs no network."""
BUILD_TIMEOUT_S = 1800
_BUILD = re.compile(r"^const BUILD = .*;$", re.MULTILINE)
_DATED = (1980, 1, 1, 0, 0, 0)


class BuildError(Exception):
    """Raised if the build fails; its message has only one line."""


def main(arguments: list[str] | None = None) -> int:
    """Build the folder of the playground; return the exit code."""
    parser = argparse.ArgumentParser(description="Build the playground as static files.")
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    folder: Path = parser.parse_args(arguments).folder
    try:
        write(folder)
    except BuildError as fault:
        print(f"scripts.playground: {fault}", file=sys.stderr)
        return 1
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    print(f"{folder}: {size / 1e6:.1f} MB")
    return 0


def is_possible() -> bool:
    """Return whether npm has installed Pyodide."""
    return (PYODIDE / "pyodide.mjs").is_file()


def write(folder: Path) -> str:
    """Write the whole folder, replacing an existing folder; return its version.

    The version is 16 hex digits that depend on the bytes of all files.

    Raises:
        BuildError: Node or Pyodide is missing, or a package cannot be downloaded.
    """
    if not is_possible():
        raise BuildError("Pyodide is missing; run: npm ci --ignore-scripts")
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(PAGE, folder)
    for name in RUNTIME:
        _copy(PYODIDE / name, folder / "pyodide" / name)
    with tempfile.TemporaryDirectory(prefix="urc-playground-") as work:
        code, library = Path(work, "code"), Path(work, "library")
        _stage_code(code)
        with zipfile.ZipFile(PYODIDE / "python_stdlib.zip") as stdlib:
            stdlib.extractall(library)  # noqa: S202  # npm checks its hash
        _compile(Path(work))
        _pack(code, folder / "python.bin")
        _zip(library, folder / "pyodide" / "python_stdlib.zip")
    _write_dashboard(folder / "dash")
    try:
        write_licences(folder / "licences")
    except FileNotFoundError as fault:
        raise BuildError(str(fault)) from fault
    return write_list(folder)


def _stage_code(code: Path) -> None:
    """Copy all Python code and documents to their paths in the worker."""
    _copy_tree(ROOT / "urc", code / "urc", ("py", "md", "json"))
    _copy_tree(ROOT / "playground", code / "playground", ("py",))
    for name in DATA:
        _copy_tree(ROOT / name, code / name, ("json", "yaml", "j2", "urdf", "svg"))
    vendor = vendored()
    if vendor is None:
        raise BuildError("the browser modules are missing; run: ./dev run --version")
    for name in ("__init__.py", "importmap.json"):
        _copy(vendor / name, code / "urc_vendor" / name)
    for package in PACKAGES:
        if package not in COMPILED:
            _copy_distribution(package, code)
    for package in COMPILED:
        _unpack_wheel(package, code)


def _copy_tree(source: Path, target: Path, kinds: Iterable[str]) -> None:
    endings = tuple(f".{kind}" for kind in kinds)
    for file in sorted(source.rglob("*")):
        place = file.relative_to(source).as_posix()
        if any(f"/{name}/" in f"/{place}" for name in SKIPPED):
            continue
        if file.is_file() and file.name.endswith(endings):
            _copy(file, target / place)


def _copy_distribution(package: str, code: Path) -> None:
    """Copy an installed package's pure Python files and metadata."""
    for file in distribution(package).files or ():
        place = file.as_posix()
        is_metadata = ".dist-info/" in place and file.name in ("METADATA", "entry_points.txt")
        is_code = file.suffix in (".py", ".json") and ".." not in place
        if is_metadata or (is_code and not any(f"/{name}/" in f"/{place}" for name in SKIPPED[:3])):
            _copy(Path(str(file.locate())), code / place)


def _unpack_wheel(package: str, code: Path) -> None:
    """Download and unpack a package's browser build, in the locked version."""
    version = distribution(package).version
    lock = (ROOT / "requirements" / "dev.txt").read_text("utf-8")
    found = re.search(rf"^{package}=={re.escape(version)} \\\n((?: +--hash=.*\n)+)", lock, re.M)
    if found is None:
        raise BuildError(f"{package} {version} is not the locked version; run: ./dev run --version")
    wheel = _kept_wheel(package, version, found[0]) or _download(package, found[0])
    with zipfile.ZipFile(wheel) as opened:
        opened.extractall(code)  # noqa: S202  # the hash of the wheel is locked


def _kept_wheel(package: str, version: str, locked: str) -> Path | None:
    """Return a browser build from an earlier download whose hash is locked, or None."""
    for wheel in WHEELS.glob(f"{package}-{version}-*{ABI}.whl"):
        if f"sha256:{hashlib.sha256(wheel.read_bytes()).hexdigest()}" in locked:
            return wheel
    return None


def _download(package: str, locked: str) -> Path:
    """Download a package's browser build with a locked hash, and cache it for later builds."""
    with tempfile.TemporaryDirectory(prefix="urc-playground-") as folder:
        wanted = Path(folder, "wanted.txt")
        wanted.write_text(locked, "utf-8")
        command = [
            sys.executable, "-m", "pip", "download", "--quiet", "--only-binary=:all:", "--no-deps",
            "--require-hashes", "--platform", ABI, "--python-version", PYTHON,
            "--implementation", "cp", "--abi", f"cp{PYTHON.replace('.', '')}",
            "--dest", folder, "--requirement", str(wanted),
        ]  # fmt: skip
        _run(command, f"pip could not download {package} for browsers")
        WHEELS.mkdir(parents=True, exist_ok=True)
        return Path(shutil.copy(next(Path(folder).glob("*.whl")), WHEELS))


def _compile(work: Path) -> None:
    """Compile all Python files, or reuse the bytecode of a build with the same files.

    The bytecode of a file depends on the files that the same process has compiled before. To
    produce the same bytes in each build, the function compiles either all files or none.
    """
    sources = sorted(work.rglob("*.py"))
    total = hashlib.sha256((PYODIDE / "package.json").read_bytes())
    for file in sources:
        total.update(f"{file.relative_to(work).as_posix()}\n".encode() + file.read_bytes())
    made = CACHE / f"{total.hexdigest()}.zip"
    if made.is_file():
        with zipfile.ZipFile(made) as compiled:
            compiled.extractall(work)  # noqa: S202  # an earlier build has written it
        for file in sources:
            if file.with_suffix(".pyc").is_file():
                file.unlink()
        return
    node = node_executable()
    if node is None:
        raise BuildError("Node is missing; ./dev installs it")
    script = ROOT / "playground" / "compile.mjs"
    _run([node, str(script), str(PYODIDE), str(work)], "Python files could not be compiled")
    CACHE.mkdir(parents=True, exist_ok=True)
    for old in CACHE.glob("*.zip"):
        old.unlink(missing_ok=True)
    with tempfile.TemporaryDirectory(prefix="urc-playground-", dir=CACHE.parent) as folder:
        packed = Path(folder, made.name)
        _zip(work, packed, "*.pyc")
        packed.replace(made)  # at once, because another build may look for it


def _run(command: list[str], fault: str) -> None:
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=BUILD_TIMEOUT_S, check=False
    )
    if done.returncode != 0:
        raise BuildError(f"{fault}: {(done.stderr or done.stdout).strip()[-2000:]}")


def _pack(folder: Path, archive: Path) -> None:
    """Write a tar archive in gzip that has the same bytes in every build.

    The archive's name must not end with ".gz", because some web servers would make the browser
    decompress the archive.
    """
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w", format=tarfile.USTAR_FORMAT) as packed:
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                entry = tarfile.TarInfo(file.relative_to(folder).as_posix())
                entry.size = file.stat().st_size
                with file.open("rb") as opened:
                    packed.addfile(entry, opened)
    archive.write_bytes(gzip.compress(buffer.getvalue(), mtime=0))


def _zip(folder: Path, archive: Path, pattern: str = "*") -> None:
    """Write a ZIP archive that has the same bytes in every build."""
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as packed:
        for file in sorted(folder.rglob(pattern)):
            if file.is_file():
                entry = zipfile.ZipInfo(file.relative_to(folder).as_posix(), _DATED)
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.external_attr = 0o644 << 16
                packed.writestr(entry, file.read_bytes())


def _write_dashboard(folder: Path) -> None:
    """Copy the files that pages load, to the paths at which a server serves them."""
    web = ("js", "mjs", "css", "svg", "png", "jpg", "webp", "json", "stl", "dae", "urdf", "woff2")
    _copy_tree_of(ROOT / "urc" / "web" / "static", folder / "static", web)
    _copy_tree_of(ROOT / "widgets", folder / "widgets", web)
    for file in sorted((ROOT / "robots").glob("*.yaml")):
        _copy(file, folder / "robots" / file.name)
    vendor = vendored()
    if vendor is not None:
        _copy_tree_of(vendor, folder / "vendor", (*web, "LICENSE"))


def _copy_tree_of(source: Path, target: Path, kinds: tuple[str, ...]) -> None:
    for file in sorted(source.rglob("*")):
        if file.is_file() and file.name.rpartition(".")[2] in kinds:
            _copy(file, target / file.relative_to(source))


def write_list(folder: Path) -> str:
    """Write the SHA-256 of all files and their version into the service worker; return the version.

    The service worker caches these files for offline use.
    """
    worker = folder / "sw.js"
    files = {
        file.relative_to(folder).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in sorted(folder.rglob("*"))
        if file.is_file() and file != worker
    }
    version = hashlib.sha256(json.dumps(files).encode()).hexdigest()[:16]
    build = json.dumps({"version": version, "files": files}, indent=0)
    text, count = _BUILD.subn(lambda _: f"const BUILD = {build};", worker.read_text("utf-8"))
    if count != 1:
        raise BuildError("sw.js has no line 'const BUILD = ...;' for the list of files")
    worker.write_text(text, "utf-8")
    return version


def _copy(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, target)


if __name__ == "__main__":
    sys.exit(main())

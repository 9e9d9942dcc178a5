"""Optional packages, and the command that installs an extra's packages.

Messages name the packages instead of ``urc[extra]``. For ``urc[extra]``, pip would search the index
for `urc` itself, even if this URC was installed from a file or a checkout.
"""

import os
import re
import shlex
import sys
from importlib.util import find_spec
from pathlib import Path

__all__ = ["install_command", "missing", "packages_of"]

_IN_EXTRA = re.compile(r"""extra\s*==\s*['"]([a-z0-9-]+)['"]""")


def missing(feature: str, package: str, extra: str) -> str:
    """Return a message that names a feature's missing package and the command to install it.

    Args:
        feature: beginning of the message, such as ``mqtt needs``.
        package: distribution name of the package.
        extra: URC extra that contains the package.
    """
    return f"{feature} the package {package}: {install_command(extra)}"


def packages_of(extra: str) -> list[str]:
    """Return an extra's requirements, such as ``paho-mqtt<3,>=2.1``.

    The list is empty if this URC has no package metadata, as in a browser.
    """
    from importlib.metadata import PackageNotFoundError, requires  # slow to load

    try:
        lines = requires("urc") or []
    except PackageNotFoundError:
        return []
    found = []
    for line in lines:
        requirement, _, marker = line.partition(";")
        named = _IN_EXTRA.search(marker)
        if named and named[1] == extra:
            found.append(requirement.strip())
    return found


def install_command(extra: str) -> str:
    """Return the command that installs an extra's packages for this URC."""
    quote = '"{}"'.format if os.name == "nt" else "'{}'".format
    packages = " ".join(quote(one) for one in packages_of(extra) or [f"urc[{extra}]"])
    if Path(sys.prefix, "pipx_metadata.json").is_file():
        return f"pipx inject urc {packages}"
    python = _shown(sys.executable)
    if find_spec("pip") is None:  # uv environments have no pip
        return f"uv pip install --python {python} {packages}"
    return f"{python} -m pip install {packages}"


def _shown(path: str) -> str:
    """Return a path quoted for a command line, relative if it is inside the current folder."""
    try:
        inside = os.path.relpath(path)
    except (ValueError, OSError):  # another drive; a deleted folder
        inside = os.pardir
    shown = path if inside.startswith(os.pardir) else inside
    if os.name == "nt":
        return f'"{shown}"' if " " in shown else shown
    return shlex.quote(shown)

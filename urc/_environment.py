"""URC's environment variables, in one table.

`python -m scripts.reference` writes docs/reference/environment.md from this table.
"""

from collections.abc import Mapping
from typing import Final

__all__ = ["DATA_DIR", "REAL_TIME", "SETTING", "SYSTEM", "TOKEN", "VARIABLES"]

DATA_DIR: Final = "URC_DATA_DIR"
TOKEN: Final = "URC_TOKEN"  # noqa: S105 - the name of a variable
REAL_TIME: Final = "URC_REAL_TIME"
SETTING: Final = "URC_SET_"
"""Name prefix of the variables that contain robot settings."""

VARIABLES: Final[Mapping[str, str]] = {
    DATA_DIR: "Data folder with people, keys, packages, settings and logs. `--data-dir` overrides"
    " the variable.",
    f"{SETTING}NAME": "Value of the robot setting `name`. The variable's name ends with the"
    " setting's name in upper case, with `_` in place of `-`. `--set` overrides the variable.",
    TOKEN: "Token with which `urc watch`, `urc send` and `urc record` sign in to a server.",
    REAL_TIME: "`no` disables the real-time priority of the guard.",
}
"""Meaning of each URC variable, by name."""
SYSTEM: Final[Mapping[str, str]] = {
    "DISPLAY": (
        "On Linux, `urc demo` opens a browser only if this variable or `WAYLAND_DISPLAY` is set."
    ),
    "LOCALAPPDATA": "On Windows, the folder that contains the default data folder.",
    "NO_COLOR": "If the variable is not empty, URC prints no colours.",
    "SSH_AUTH_SOCK": "Socket of the SSH agent with the keys for transports with `agent: true`.",
    "XDG_DATA_HOME": "On Linux, the folder that contains the default data folder.",
}
"""URC's use of each variable that other programs also read, by name."""

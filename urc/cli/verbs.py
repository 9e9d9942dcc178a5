"""The subcommands of `urc` with descriptions, under the headings of the help text.

Layer 6. For a fast start, this module imports nothing.
"""

__all__ = ["GROUPS", "VERBS", "module_of"]

VERBS: dict[str, str] = {
    "demo": "emulate all shipped robots and open the dashboard in a browser",
    "serve": "serve the dashboard for real robots",
    "validate": "check documents and run their tests",
    "explain": "explain a problem code and how to correct the problem",
    "resolve": "print a profile as one document, with the origin of every key",
    "migrate": "replace old names of keys and values in documents",
    "docs": "print the manual page of a profile as Markdown",
    "simulate": "emulate the robot of a profile on its real ports",
    "watch": "print a robot's signals as JSON lines",
    "send": "run one command of a robot and print the reply",
    "stop": "stop robots of a server, and print the result of each robot",
    "record": "record a session to a file, until Ctrl-C",
    "replay": "replay a recording in the dashboard",
    "export": "write a video of a recording to an MP4 file",
    "new": "create the files of a new widget",
    "repo": "manage package repositories, upload tokens and keys",
    "install": "install a package and its dependencies, after showing the permissions",
    "update": "update installed packages after showing the changes, or undo an update",
    "search": "search the repositories for packages",
    "list": "list the installed packages",
    "remove": "remove an installed package and its unused dependencies",
    "bundle": "pack a package and its dependencies into one file",
    "publish": "publish a package to a repository",
    "trust": "show the host key of an SSH server, and store it after confirmation",
    "audit": "print, export or check the audit log",
    "people": "manage people, their roles and passphrases",
    "devices": "pair phones, tablets and computers, and manage them",
    "tokens": "manage the tokens of programs",
    "sign-ins": "list and end the sign-ins of browsers, devices and programs",
    "fleet": "make a fleet of several servers, invite sites and revoke them",
    "backup": "save people, keys, settings and logs to one file",
    "restore": "restore a backup of people, keys, settings and logs",
    "discover": "find serial ports, ROS topics, and robots on the network",
    "schema": "print the JSON Schema of a kind of document",
    "doctor": "check the features of this machine",
    "completion": "print the completion script for bash, zsh or fish",
}

GROUPS: dict[str, tuple[str, ...]] = {
    "drive": (
        *("demo", "serve", "watch", "send", "stop", "record", "replay", "export", "trust"),
        "discover",
    ),
    "write and check documents": (
        *("validate", "explain", "simulate", "docs", "resolve", "migrate", "new", "schema"),
    ),
    "packages": (*("search", "install", "update", "list", "remove", "bundle", "publish", "repo"),),
    "people and rights": ("people", "devices", "tokens", "sign-ins", "audit"),
    "this machine": ("doctor", "fleet", "backup", "restore", "completion"),
}
"""Headings of the help text, each with its subcommands."""


def module_of(verb: str) -> str:
    """Return the name of a subcommand's module."""
    return f"urc.cli.{verb.replace('-', '_')}"

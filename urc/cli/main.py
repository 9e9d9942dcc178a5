"""The `urc` command: finds the verb, imports it alone, and turns every failure into one line.

Layer 6. Nothing heavy may be imported here, not even `typing`: `urc --version` and each verb pay
only for what they use.
"""

import os
import sys
from collections.abc import Sequence

__all__ = ["VERBS", "main"]

VERBS: dict[str, str] = {
    "demo": "serve all shipped robots, emulated, and open the browser",
    "serve": "serve the dashboard for real robots",
    "validate": "check documents and run their tests",
    "explain": "explain the code of a problem, with a correction",
    "resolve": "print a profile as one document, with the place of every key",
    "migrate": "rename old keys and values in documents; every other byte stays",
    "docs": "write the manual page of a profile, as Markdown",
    "simulate": "emulate the robot of a profile on its real ports",
    "watch": "print a robot's signals as JSON lines",
    "send": "run one command and print its reply",
    "record": "record a session to a file; Ctrl-C stops",
    "replay": "replay a recording in the dashboard",
    "new": "create the files of a new widget",
    "repo": "manage repositories of packages, their tokens and keys",
    "install": "install a package and its dependencies, after showing its permissions",
    "update": "update installed packages, after showing the changes; or revert",
    "search": "search the repositories for packages",
    "list": "list the installed packages",
    "remove": "remove an installed package and its unused dependencies",
    "bundle": "pack a package and its dependencies into one file",
    "publish": "publish a package to a repository",
    "trust": "show the host key of an SSH server, and store it on consent",
    "audit": "print the audit log of motions as JSON lines",
    "discover": "find robots on the network, serial ports, and ROS topics",
    "schema": "print the JSON Schema of a kind of document",
    "doctor": "check the features of this machine",
}

_INTERRUPTED = 130
"""The exit code of a shell after SIGINT: 128 + 2."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line; return its exit code: 0 success, 1 problems or failure, 2 wrong use."""
    _mend_streams()
    words = list(sys.argv[1:] if argv is None else argv)
    try:
        code = _answer(words)
    except KeyboardInterrupt:
        _discard_output()  # the rest could block
        return _INTERRUPTED
    except BrokenPipeError:
        code = 0  # the reader has enough, as in `urc watch … | head`
    except Exception as error:  # supervisor: the last resort
        from urc.cli.error_report import explain

        code = explain(error, f"urc {words[0]}" if words and words[0] in VERBS else "urc")
    return _flush(code)


def _answer(words: list[str]) -> int:
    if not words:
        print(_usage(), file=sys.stderr)
        return 2
    verb, *rest = words
    if verb == "help" and rest:
        verb, rest = rest[0], ["--help"]
    if verb in ("-h", "--help", "help"):
        print(_usage())
        return 0
    if verb in ("-V", "--version"):
        from urc import __version__

        print(f"urc {__version__}")
        return 0
    if verb not in VERBS:
        return _unknown(verb)
    return _run(verb, rest)


def _run(verb: str, rest: list[str]) -> int:
    from importlib import import_module

    from urc.cli.arguments import parse

    module = import_module(f"urc.cli.{verb}")
    arguments = parse(verb, VERBS[verb], module, rest)
    return arguments if isinstance(arguments, int) else int(module.run(arguments))


def _usage() -> str:
    width = max(map(len, VERBS))
    lines = [f"  {name:<{width}}  {text}" for name, text in VERBS.items()]
    return "\n".join(
        (
            "usage: urc VERB …",
            "",
            "Describe a robot in one YAML file, and drive it from any browser.",
            "",
            *lines,
            "",
            "'urc VERB --help' explains a verb. 'urc --version' prints the version.",
        )
    )


def _unknown(verb: str) -> int:
    from difflib import get_close_matches

    from urc.cli.output import complain

    close = get_close_matches(verb, VERBS, n=1)
    hint = f"did you mean '{close[0]}'?" if close else "'urc --help' lists all verbs"
    complain(f"urc: there is no verb {verb!r}; {hint}")
    return 2


def _mend_streams() -> None:
    """Open missing standard streams, and let all of them take any text.

    WARNING: missing streams come first. Else the next file or socket would get the number of a
    standard stream, and printed text would go to a robot.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    sys.stdout = sys.stdout or os.fdopen(1, "w", encoding="utf-8", closefd=False)
    sys.stderr = sys.stderr or os.fdopen(2, "w", encoding="utf-8", closefd=False)
    # Names of files and robots may have characters that the terminal's encoding lacks.
    reconfigure = getattr(sys.stdout, "reconfigure", None)
    if reconfigure:
        reconfigure(errors="backslashreplace")


def _flush(code: int) -> int:
    """Flush the output, so that its failure is reported like any other."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        _discard_output()
    except OSError as error:
        from urc.cli.output import complain

        _discard_output()
        complain(f"urc: the output cannot be written: {error.strerror or error}")
        return 1
    return code


def _discard_output() -> None:
    """Discard pending output: Python would try to write it, and complain, at its exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    sys.exit(main())

"""The `urc` program, which imports only the requested subcommand and reports failures in one line.

Layer 6. For a fast start, this module must not import large modules such as `typing`. `urc
--version` loads no subcommand, and each subcommand loads only its own imports.
"""

import os
import sys
from collections.abc import Sequence

from urc.cli.verbs import GROUPS, VERBS, module_of

__all__ = ["GROUPS", "VERBS", "main", "module_of"]

_FIRST_STEPS: dict[str, str] = {
    "urc demo": "drive emulated robots in the browser",
    "urc demo --phone": "drive emulated robots on a phone, with a QR code",
    "urc serve FILE": "drive your robot, described in a YAML file",
    "urc validate FILE": "check this file, without the robot",
    "urc doctor": "check this machine",
}
"""Example commands for new users, with descriptions."""

_INTERRUPTED = 130
"""A shell's exit code after SIGINT: 128 + 2."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line; return its exit code.

    Exit codes are 0 for success, 1 for problems or failure, and 2 for invalid use.
    """
    _mend_streams()
    if "_ARGCOMPLETE" in os.environ:  # a shell requests completions
        from urc.cli.completion import answer

        answer()
    words = list(sys.argv[1:] if argv is None else argv)
    try:
        code = _answer(words)
    except KeyboardInterrupt:
        _discard_output()  # pending output could block
        return _INTERRUPTED
    except BrokenPipeError:
        code = 0  # the reader has closed the pipe, as in `urc watch … | head`
    except Exception as error:  # supervisor: the last resort
        from urc.cli.error_report import explain

        code = explain(error, f"urc {words[0]}" if words and words[0] in VERBS else "urc")
    return _flush(code)


def _answer(words: list[str]) -> int:
    if not words:
        print(_first_steps(), file=sys.stderr)
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

    module = import_module(module_of(verb))
    arguments = parse(verb, VERBS[verb], module, rest)
    return arguments if isinstance(arguments, int) else int(module.run(arguments))


def _first_steps() -> str:
    width = max(map(len, _FIRST_STEPS))
    lines = (f"  {command:<{width}}   {text}" for command, text in _FIRST_STEPS.items())
    return "\n".join(
        (
            "URC: describe a robot in one YAML file, and drive it from any browser.",
            "",
            *lines,
            "",
            "'urc --help' lists all subcommands. 'urc SUBCOMMAND --help' explains a subcommand.",
        )
    )


def _usage() -> str:
    width = max(map(len, VERBS))
    lines = [
        line
        for title, verbs in GROUPS.items()
        for line in ("", f"{title}:", *(f"  {verb:<{width}}  {VERBS[verb]}" for verb in verbs))
    ]
    return "\n".join(
        (
            "usage: urc SUBCOMMAND …",
            "",
            "Describe a robot in one YAML file, and drive it from any browser.",
            *lines,
            "",
            "'urc SUBCOMMAND --help' explains a subcommand. 'urc --version' prints the version.",
        )
    )


def _unknown(verb: str) -> int:
    from difflib import get_close_matches

    from urc.cli.output import complain

    close = get_close_matches(verb, VERBS, n=1)
    hint = f"did you mean '{close[0]}'?" if close else "'urc --help' lists all subcommands"
    complain(f"urc: unknown subcommand {verb!r}; {hint}")
    return 2


def _mend_streams() -> None:
    """Open missing standard streams, and make all streams accept any text.

    WARNING: open missing streams before any other file or socket. Otherwise, the next file or
    socket receives the number of the missing stream, and printed text could reach a robot.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    sys.stdout = sys.stdout or os.fdopen(1, "w", encoding="utf-8", closefd=False)
    sys.stderr = sys.stderr or os.fdopen(2, "w", encoding="utf-8", closefd=False)
    # Names of files and robots may contain characters outside the terminal's encoding.
    reconfigure = getattr(sys.stdout, "reconfigure", None)
    if reconfigure:
        reconfigure(errors="backslashreplace")


def _flush(code: int) -> int:
    """Flush the output, so that write errors are reported like all other errors."""
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
    """Discard pending output, so that Python does not retry the failed write at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    sys.exit(main())

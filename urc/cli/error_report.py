"""Error messages for all subcommands: one line for each problem, without a traceback."""

from urc.cli.output import complain
from urc.problems import ProblemsError, UrcError, to_text

__all__ = ["Misuse", "explain"]


class Misuse(UrcError):
    """Raised for invalid use of the command line; the exit code is 2."""


def explain(error: Exception, program: str) -> int:
    """Print the message for an error in a `program` such as ``urc watch``; return the exit code."""
    match error:
        case ProblemsError():
            for problem in error.problems:
                for line in to_text(problem).splitlines():
                    complain(line)
        case UrcError():
            complain(f"{program}: {error}")
        case ModuleNotFoundError() if not str(error.name).startswith("urc."):
            complain(
                f"{program}: {error.name} is not installed; 'urc doctor' lists missing packages"
            )
        case OSError():
            where = f"{error.filename}: " if error.filename else ""
            complain(f"{program}: {where}{error.strerror or error}")
        case _:
            complain(f"{program}: {_mistake(error)}")
    return 2 if isinstance(error, Misuse) else 1


def _mistake(bug: Exception) -> str:
    """Return a one-line message that asks the user to report a bug in URC."""
    from traceback import extract_tb  # slow to load, and needed only here

    frames = extract_tb(bug.__traceback__)
    place = f" at {frames[-1].filename}:{frames[-1].lineno}" if frames else ""
    return f"this is a bug in URC; please report it: {type(bug).__name__}{place}: {bug}"

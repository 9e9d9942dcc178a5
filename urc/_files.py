"""Reads regular files up to a size limit, and rejects directories and pipes.

Private to `urc.source`.
"""

import os
import stat

from urc.problems import Problem, ProblemsError

__all__ = ["read_bytes", "refused", "similar_file", "too_large"]


def read_bytes(path: str, most: int) -> bytes:
    """Return the content of a regular file, as bytes.

    Raises:
        ProblemsError: the file cannot be read, or has more than `most` bytes.
    """
    try:
        status = os.stat(path)
        if stat.S_ISDIR(status.st_mode):
            raise refused(
                path,
                "is-directory",
                "expected a file, found a directory",
                _documents_in(path),
            )
        # Opening a pipe or a device could block.
        if not stat.S_ISREG(status.st_mode):
            raise refused(path, "not-a-file", "this is not a regular file")
        if status.st_size > most:
            raise refused(path, "too-large", too_large(most))
        with open(path, "rb") as file:
            content = file.read(most + 1)
    except FileNotFoundError:
        raise refused(path, "no-such-file", "there is no such file", _similar(path)) from None
    except NotADirectoryError:
        raise refused(
            path, "no-such-file", "part of this path is a file, not a directory"
        ) from None
    except PermissionError:
        raise refused(
            path,
            "not-readable",
            "permission to read this file is denied",
            "allow reading with 'chmod u+r'",
        ) from None
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise refused(path, "not-readable", f"this file cannot be read: {reason}") from None
    except ValueError:
        raise refused(path, "not-readable", "this is not a valid file name") from None
    if len(content) > most:
        raise refused(path, "too-large", too_large(most))
    return content


def too_large(most: int) -> str:
    """Return the error message for a file of more than `most` bytes."""
    return f"this document is larger than {most // 1024} KiB"


def refused(file: str, code: str, message: str, hint: str = "") -> ProblemsError:
    """Return the error that rejects a file as a whole, without a line number."""
    return ProblemsError([Problem(code, message, file, hint=hint)])


def _documents_in(folder: str) -> str:
    try:
        names = sorted(name for name in os.listdir(folder) if name.endswith((".yaml", ".yml")))
    except OSError:
        return ""
    return (
        f"pass a document in this directory, such as {os.path.join(folder, names[0])}"
        if names
        else ""
    )


def similar_file(path: str) -> str:
    """Return a similar file name in the folder of `path`; "" if no name is similar."""
    from difflib import get_close_matches

    folder, name = os.path.split(path)
    stem, ending = os.path.splitext(name)
    try:
        stems = [
            one for one, end in map(os.path.splitext, os.listdir(folder or ".")) if end == ending
        ]
    except (OSError, ValueError):
        return ""
    near = get_close_matches(stem, stems[:1000], 1)
    return near[0] + ending if near else ""


def _similar(path: str) -> str:
    name = similar_file(path)
    return f"did you mean '{os.path.join(os.path.dirname(path), name)}'?" if name else ""

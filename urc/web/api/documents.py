"""A robot's document as one YAML file, without the server's folder paths.

Layer 5. A document contains no setting values and therefore no secrets from settings. Call
`document_of` in a thread, because it blocks while it reads the source files.
"""

from pathlib import PurePath

from urc.config.resolve import resolve
from urc.model.profile import Profile
from urc.problems import has_errors
from urc.runtime.widget_registry import widget_folder_of
from urc.web.serve.replies import ApiError

__all__ = ["document_of"]


def document_of(profile: Profile) -> bytes:
    """Return a profile as one YAML file, merged with its driver, interfaces and other documents.

    The comments contain the file name and line of each key, without folders.

    Raises:
        ApiError: the document can no longer be read.
    """
    found = resolve(profile.file, widget_folder_of(profile.file), profile)
    if not found.text or has_errors(found.problems):
        raise ApiError(409, "the document of this robot can no longer be read", "not-readable")
    head, *lines = found.text.splitlines()
    head = f"# {PurePath(profile.file).name}, merged by 'urc resolve'."
    return "\n".join((head, *map(_without_folder, lines), "")).encode()


def _without_folder(line: str) -> str:
    """Return a line of the resolved document with the folder removed from its comment."""
    before, mark, origin = line.rpartition("  # ")
    if not mark or not origin.rpartition(":")[2].isdecimal():
        return line
    return f"{before}{mark}{PurePath(origin).name}"

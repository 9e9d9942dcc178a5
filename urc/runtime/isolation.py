"""Preview third-party documents in a separate process with limited memory and time.

``python -m urc.runtime.isolation`` reads a task as JSON from standard input and prints the preview.
A document that takes much time or memory therefore cannot slow down the calling program.
"""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from urc._translatable import Phrase, joined, phrase
from urc.problems import Problem, ProblemsError, UrcError
from urc.runtime.package_preview import PackagePreview, look

__all__ = ["PreviewWorker", "bound_this_process", "look_apart"]

TOTAL_S: Final = 60.0
"""Maximum time for a preview, in seconds; long enough for slow computers."""
PROCESSOR_S: Final = 30
MEMORY_BYTES: Final = 1 << 30
COMMAND: Final = ("-P", "-m", "urc.runtime.isolation")
"""Command-line arguments for Python; ``-P`` prevents imports from the working folder."""
_ANSWER_BYTES: Final = 16 << 20


def look_apart(
    document: Path, folder: Path, widgets: Sequence[str], *, total_s: float = TOTAL_S
) -> PackagePreview:
    """Return the result of `urc.runtime.package_preview.look`, or raise the same errors.

    Args:
        document: the document of the package.
        folder: folder that contains all files of the package and its dependencies.
        widgets: names of the widgets in the package.
        total_s: maximum time for the preview, in seconds.

    Raises:
        ProblemsError: the document has errors.
        UrcError: the document refers to a file outside the folder, has this machine as a fixed
            host, or exceeds the memory or time limit.
    """
    asked = json.dumps([str(document), str(folder), list(widgets)])
    command = [sys.executable, *COMMAND]
    try:
        done = subprocess.run(  # noqa: S603 (our own program)
            command, input=asked.encode(), capture_output=True, timeout=total_s, check=False
        )
    except subprocess.TimeoutExpired:
        raise UrcError(f"{document.name}: the preview took longer than {total_s:g} s") from None
    try:
        said = json.loads(done.stdout)
    except ValueError:
        raise UrcError(
            f"{document.name}: the preview needs more than {PROCESSOR_S} s of processor time or"
            f" {MEMORY_BYTES >> 20} MiB of memory"
        ) from None
    if "problems" in said:
        raise ProblemsError([Problem(*one) for one in said["problems"]])
    if "fault" in said:
        raise UrcError(said["fault"])
    return PackagePreview(
        [_phrase(one) for one in said["may"]], said["wire"], [*map(_phrase, said["risks"])]
    )


class PreviewWorker:
    """A cache of previews, one for each document."""

    def __init__(self) -> None:
        self._seen: dict[Path, PackagePreview] = {}

    def __call__(self, document: Path, folder: Path, widgets: Sequence[str]) -> PackagePreview:
        """Return the cached or new result of `look_apart`, or raise the same errors."""
        if document not in self._seen:
            self._seen[document] = look_apart(document, folder, widgets)
        return self._seen[document]


def bound_this_process(processor_s: int, memory_bytes: int) -> None:
    """Limit the resources of this process and give it a lower priority than motion.

    On Windows, only the caller's timeout applies.
    """
    if sys.platform == "win32":
        return
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
    resource.setrlimit(resource.RLIMIT_CPU, (processor_s, processor_s))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.nice(10)


def _said(line: str) -> Any:
    """Return one permission as JSON data that keeps its text translatable."""
    if not isinstance(line, Phrase):
        return line
    if line.pieces:
        return {"between": line.between, "pieces": [_said(one) for one in line.pieces]}
    return {"text": line.text, "names": {name: _said(one) for name, one in line.names.items()}}


def _phrase(said: Any) -> str:
    if isinstance(said, str):
        return said
    if "pieces" in said:
        return joined(said["between"], [_phrase(one) for one in said["pieces"]])
    return phrase(said["text"], **{name: _phrase(one) for name, one in said["names"].items()})


def _main() -> int:
    bound_this_process(PROCESSOR_S, MEMORY_BYTES)
    document, folder, widgets = json.loads(sys.stdin.buffer.read())
    said: dict[str, Any]
    try:
        seen = look(Path(document), Path(folder), widgets)
    except ProblemsError as error:
        said = {"problems": error.problems}
    except UrcError as error:
        said = {"fault": str(error)}
    else:
        said = {
            "may": [_said(line) for line in seen.permissions],
            "wire": dict(seen.wire),
            "risks": [_said(line) for line in seen.risks],
        }
    text = json.dumps(said)
    if len(text) > _ANSWER_BYTES:
        text = json.dumps({"fault": f"{document}: the preview is too large"})
    sys.stdout.write(text)
    return 0


if __name__ == "__main__":
    sys.exit(_main())

"""Rendering of third-party widget templates in a separate process, with memory and time limits.

``python -m urc.web.show.isolated_markup`` reads templates and variables as JSON from standard input
and writes the markup to standard output. Layer 5.

The template sandbox blocks access to Python objects but cannot stop endless loops. Markup is
cached, because it depends only on the template, variables and language.
"""

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from threading import Lock
from typing import Any, Final, NamedTuple

from markupsafe import Markup

from urc.expressions import Template
from urc.runtime.isolation import bound_this_process
from urc.web import words
from urc.web.show.sandbox import fault_line, widget_template

__all__ = ["MOST_CHARACTERS", "RenderedMarkup", "markup_of"]

MOST_CHARACTERS: Final = 65536
"""Maximum number of characters in the markup of one cell."""
TOTAL_S: Final = 20.0
"""Time limit for rendering several templates together, in seconds. The limit is long enough even
for slow or busy machines."""
PROCESSOR_S: Final = 4
MEMORY_BYTES: Final = 512 << 20
_COMMAND: Final = ("-P", "-m", "urc.web.show.isolated_markup")
_KEPT: Final = 256


class RenderedMarkup(NamedTuple):
    """The result of rendering one template."""

    html: Markup
    """Rendered markup; "" after a failure."""
    fault: str
    """Reason for the failure, in one line; "" on success."""
    line: int = 1
    """Template line of the failure, counted from 1."""


_made: dict[str, RenderedMarkup] = {}
_lock = Lock()


def markup_of(wanted: Sequence[tuple[str, Mapping[str, object]]]) -> list[RenderedMarkup]:
    """Return the templates' markup in the current language; block until all are rendered.

    Each element of `wanted` contains one template's source and variables.
    """
    language = words.language.get()
    jobs = [json.dumps([language, source, _plain(variables)]) for source, variables in wanted]
    with _lock:
        lacks = [job for job in dict.fromkeys(jobs) if job not in _made]
        found = {job: _made[job] for job in jobs if job in _made}
    new = dict(zip(lacks, _rendered(lacks), strict=True)) if lacks else {}
    with _lock:
        _made.update(new)
        for job in list(_made)[: max(0, len(_made) - _KEPT)]:
            del _made[job]
    return [{**found, **new}[job] for job in jobs]


def _rendered(jobs: list[str]) -> list[RenderedMarkup]:
    """Return the markup of templates; a crash in one template does not affect the others."""
    said = _asked(jobs)
    if said is not None:
        return said
    if len(jobs) > 1:
        return [made for job in jobs for made in _rendered([job])]
    fault = (
        f"the template cannot be rendered with {PROCESSOR_S} s of processor time and"
        f" {MEMORY_BYTES >> 20} MiB of memory"
    )
    return [RenderedMarkup(Markup(), fault)]


def _asked(jobs: list[str]) -> list[RenderedMarkup] | None:
    """Return what the process wrote to its standard output; None if the process ended early."""
    try:
        done = subprocess.run(  # noqa: S603 (our own program)
            [sys.executable, *_COMMAND],
            input=json.dumps(jobs).encode(),
            capture_output=True,
            timeout=TOTAL_S,
            check=False,
        )
        said = json.loads(done.stdout)
    except (subprocess.TimeoutExpired, ValueError):
        return None
    # Safe: autoescaped, and mounted in a frame without an origin.
    return [RenderedMarkup(Markup(html), fault, line) for html, fault, line in said]  # noqa: S704


def _plain(value: object) -> Any:
    """Return a variable converted to JSON types; a named tuple becomes a mapping."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, Template):
        return value.source
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return {name: _plain(getattr(value, name)) for name in value._fields}
    if isinstance(value, Mapping):
        return {str(name): _plain(one) for name, one in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [_plain(one) for one in value]
    return str(value)


def _render(job: str) -> tuple[str, str, int]:
    language, source, variables = json.loads(job)
    words.language.set(language)
    pieces: list[str] = []
    count = 0
    try:
        for piece in widget_template(source).generate(variables):
            count += len(piece)
            if count > MOST_CHARACTERS:
                return "", f"the markup has more than {MOST_CHARACTERS} characters", 1
            pieces.append(piece)
    except Exception as error:  # a template may raise anything
        text = str(error).partition("\n")[0][:500]
        return "", f"{type(error).__name__}: {text}", fault_line(error)
    return "".join(pieces), "", 1


def _main() -> int:
    bound_this_process(PROCESSOR_S, MEMORY_BYTES)
    sys.stdout.write(json.dumps([_render(job) for job in json.loads(sys.stdin.buffer.read())]))
    return 0


if __name__ == "__main__":
    sys.exit(_main())

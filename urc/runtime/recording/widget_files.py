"""The files of a robot's widgets, such as a model, as attachments of a recording.

Layer 4. Another machine needs these files to replay the recording.
"""

import os
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from urc.config.link.resources import file_fault
from urc.model.profile import Profile
from urc.runtime.recording.shapes import FILES

__all__ = ["MOST_FILE_BYTES", "attach_files", "unpack_files"]

MOST_FILE_BYTES: Final = 16 << 20
"""Maximum total size of the widget files in one recording, in bytes."""


def attach_files(writer: Any, profile: Profile) -> list[str]:
    """Attach the files; return the names of the missing, unreadable and oversized files."""
    left, lost = MOST_FILE_BYTES, []
    files = {name: place for use in profile.uses() for name, place in use.files.items()}
    for name, place in files.items():
        try:
            data = Path(place).read_bytes() if os.path.getsize(place) <= left else None
        except OSError:
            data = None
        if data is None or len(data) > left:
            lost.append(name)
            continue
        left -= len(data)
        now_ns = time.time_ns()
        writer.add_attachment(now_ns, now_ns, FILES + name, "application/octet-stream", data)
    return lost


def unpack_files(files: Mapping[str, bytes], folder: Path) -> None:
    """Write the files of a recording into a folder; skip names that no document could contain."""
    for name, data in files.items():
        if file_fault(name):
            continue
        place = folder / name
        with suppress(OSError):  # in a forged recording, a file and a folder may share a name
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(data)

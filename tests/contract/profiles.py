"""The profiles of shipped and sample documents, each loaded once for all tests."""

import os
from functools import cache
from pathlib import Path

from urc.config.load import check
from urc.model.profile import Profile
from urc.problems import to_text
from urc.runtime.registries import built_in_catalog

__all__ = ["profile_of"]


@cache
def profile_of(file: Path) -> Profile:
    """Return the profile in a document without findings, warnings included."""
    checked = check(os.fspath(file), built_in_catalog())
    assert [to_text(problem) for problem in checked.problems] == []
    assert checked.profile is not None
    return checked.profile

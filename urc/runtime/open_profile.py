"""Load a robot's document, with the widgets in its folder and installed interfaces.

Layer 4. A driver's document does not declare an interface. An installed driver is shown with the
interfaces that are installed for it.
"""

from os import PathLike
from pathlib import Path
from typing import Final

from urc.config.interface_fit import fit_interface
from urc.config.load import load_profile
from urc.model.profile import Profile
from urc.packages.names import PackageError
from urc.packages.store import blocked_lines_of, ecosystem_of
from urc.runtime.registries import built_in_catalog
from urc.runtime.widget_registry import widget_folder_of

__all__ = ["open_document"]

_DRIVER: Final = "driver.yaml"
_MADE: Final = "default"
"""Name of the interface that is generated for a document without an interface."""


def open_document(path: str | PathLike[str]) -> Profile:
    """Load the document of a robot or driver and return its profile.

    Raises:
        ProblemsError: the document has errors; the exception lists them.
        PackageError: the document is installed, and its package is blocked.
    """
    if blocked := blocked_lines_of(Path(path)):
        raise PackageError("; ".join(blocked))
    profile = load_profile(path, built_in_catalog(), widget_folder_of(path))
    home = ecosystem_of(Path(path))
    if home is None or Path(path).name != _DRIVER:
        return profile
    interfaces, widgets = dict(profile.interfaces), dict(profile.widgets)
    for document in sorted(home.glob("interfaces/*/interface.yaml")):
        found = fit_interface(str(document), profile, widget_folder_of(document))
        name = document.parent.name
        if found.interface is not None and name not in interfaces:
            interfaces[name] = found.interface._replace(name=name)
            widgets |= found.widgets
    if len(interfaces) > 1 and _MADE in interfaces:
        interfaces[_MADE] = interfaces.pop(_MADE)  # the generated interface comes last
    return profile._replace(interfaces=interfaces, widgets=widgets)

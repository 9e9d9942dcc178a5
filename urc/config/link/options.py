"""Options of a line that are one setting: can that setting be what the option wants?

Without this check, a text in place of a port fails only at the first connection.
"""

import re
from collections.abc import Mapping
from typing import Any, Final

from urc.config.part import Findings, Part
from urc.config.schemas import read_schema
from urc.expressions import Template
from urc.model.profile import Setting

__all__ = ["check_option"]

_ONE_SETTING: Final = re.compile(r"\{\{\s*settings\.([a-z]\w*)\s*\}\}")
_NUMBERS: Final = ("port", "integer", "number")


def check_option(
    part: Part, kind: str, template: Template, settings: Mapping[str, Setting], findings: Findings
) -> None:
    """Report a setting of the wrong type.

    Args:
        part: the option.
        kind: type of the transport, a definition of the driver's schema where it is URC's own.
        template: the option as a template.
        settings: of the profile.
        findings: collects the problems.
    """
    found = _ONE_SETTING.fullmatch(template.source)
    setting = settings.get(found[1]) if found else None
    if found is None or setting is None:
        return
    schema: Any = read_schema("driver.schema.json")
    option = schema["$defs"].get(kind, {}).get("properties", {}).get(part.name, {})
    wants_number = "pattern" in option and "integer" in option.get("type", ())
    if wants_number and setting.type not in _NUMBERS:
        wanted, hint = "a whole number", "port" if part.name == "port" else "integer"
    elif part.name == "host" and setting.type in (*_NUMBERS, "boolean"):
        wanted, hint = "a name or an address", "host"
    else:
        return
    findings.error(
        part,
        "wrong-type",
        f"'{part.name}' is {wanted}, and the setting {found[1]!r} is of type {setting.type}",
        hint=f"give the setting 'type: {hint}'",
    )

"""Tables of the modules that parse frame forms, by key in a document."""

from collections.abc import Mapping
from typing import Final

__all__ = ["READ_FORMS", "WRITE_FORMS"]

READ_FORMS: Final[Mapping[str, str]] = {
    "regex": "urc.config.parse.forms.regex",
    "pattern": "urc.config.parse.forms.pattern",
    "split": "urc.config.parse.forms.split",
    "keyvalue": "urc.config.parse.forms.keyvalue",
    "json": "urc.config.parse.forms.json",
    "xml": "urc.config.parse.forms.xml",
    "equals": "urc.config.parse.forms.equals",
    "raw": "urc.config.parse.forms.raw",
    "struct": "urc.config.parse.forms.struct",
}
WRITE_FORMS: Final[Mapping[str, str]] = {
    "text": "urc.config.parse.forms.text",
    "hex": "urc.config.parse.forms.hex",
    "bytes": "urc.config.parse.forms.bytes",
    "json": "urc.config.parse.forms.json_text",
    "struct": "urc.config.parse.forms.struct",
    "publish": "urc.config.parse.forms.envelope",
    "call": "urc.config.parse.forms.envelope",
    "goal": "urc.config.parse.forms.envelope",
    "cancel": "urc.config.parse.forms.envelope",
    "request": "urc.config.parse.forms.envelope",
    "get": "urc.config.parse.forms.envelope",
}

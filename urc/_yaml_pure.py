"""PyYAML's pure Python parser, with libyaml's rules for text inside braces.

Private to `urc.source`. Inside ``{ }`` and ``[ ]``, PyYAML's own parser ends unquoted text at
``?``. Without this module, ``{ send: MODE? }`` would be a syntax error only on machines without
libyaml.
"""

from typing import Any, Final

from yaml.parser import Parser
from yaml.reader import Reader
from yaml.scanner import Scanner, ScannerError

__all__ = ["PureParser"]

_LETTER: Final = "\ufffc"
"""Character without a meaning in YAML, which `peek` returns for each ``?`` in unquoted text."""
_BLANK: Final = "\0 \t\r\n\x85\u2028\u2029"


class PureParser(Reader, Scanner, Parser):
    """A parser that produces the same events and errors as libyaml."""

    def __init__(self, text: str) -> None:
        """Start reading `text`."""
        self._is_plain = False
        """Whether the scanner is inside unquoted text."""
        Reader.__init__(self, text)
        Scanner.__init__(self)
        Parser.__init__(self)

    def scan_plain(self) -> Any:
        """Scan unquoted text, with libyaml's rules inside braces, and return its token."""
        self._is_plain = self.flow_level > 0
        try:
            return super().scan_plain()
        finally:
            self._is_plain = False

    def peek(self, index: int = 0) -> str:
        """Return the character at `index` from the current position, as libyaml would treat it."""
        found: str = super().peek(index)
        if not self._is_plain:
            return found
        if found == ":" and super().peek(index + 1) in ",?[]{}":
            self.forward(index)
            mark = self.get_mark()
            raise ScannerError("while scanning a plain scalar", mark, "found unexpected ':'", mark)
        return _LETTER if found == "?" else found

    def check_plain(self) -> bool:
        """Return whether unquoted text starts at the current position."""
        if self.flow_level and self.peek() == ":":
            return False
        return bool(super().check_plain())

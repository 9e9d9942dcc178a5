"""Regular expressions in documents, limited to patterns with linear run time.

`urc._patterns` contains the implementation, which expressions also use.
"""

from urc._patterns import (
    Pattern,
    PatternError,
    can_be_empty,
    compile_pattern,
    example,
    is_plain_group,
    literal_prefix,
)

__all__ = [
    "Pattern",
    "PatternError",
    "can_be_empty",
    "compile_pattern",
    "example",
    "is_plain_group",
    "literal_prefix",
]

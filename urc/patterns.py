"""Regular expressions in documents, limited to patterns with linear run time.

The implementation is in `urc._patterns`, for patterns and for expressions.
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

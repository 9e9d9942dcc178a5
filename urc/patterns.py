"""Regular expressions of documents: matched in linear time, or refused.

`urc._patterns` has the implementation, which expressions use, too.
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

"""Regular expressions of documents: matched in linear time, or refused.

Floor 1. The work is done in `urc._patterns`, which expressions stand on, too.
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

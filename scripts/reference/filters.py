"""The reference page for expressions and filters. URC computes the results of the examples."""

from collections.abc import Mapping

from scripts.reference.markdown import table
from urc._number_types import NUMBER_NAMES
from urc.expressions import compile_expression
from urc.filters.table import FILTERS

__all__ = ["EXAMPLES", "page"]

EXAMPLES: Mapping[str, tuple[str, str]] = {
    "abs": ("-3 | abs", "absolute value"),
    "acos": ("1 | acos", "arc cosine, in radians"),
    "asin": ("0 | asin", "arc sine, in radians"),
    "atan": ("0 | atan", "arc tangent, in radians"),
    "atan2": ("0 | atan2(1)", "angle of the point (argument, value), in radians"),
    "b64decode": ("'T0s=' | b64decode", "bytes decoded from Base64 text"),
    "b64encode": ("'OK' | b64encode", "Base64 encoding of bytes or text"),
    "ceil": ("1.2 | ceil", "number rounded up to a whole number"),
    "checksum": (
        "'123456789' | checksum('crc16-modbus')",
        "checksum of bytes or text, with a named algorithm",
    ),
    "clamp": ("130 | clamp(-100, 100)", "number limited to the range between the two arguments"),
    "column": ("[[1, 2], [3, 4]] | column(1)", "one column of a list of rows"),
    "cos": ("0 | cos", "cosine of an angle in radians"),
    "cut": ("['ab', 'cd'] | cut(1)", "slice of each text or list in a list"),
    "ddmm": ("'4730.0' | ddmm", "degrees from a number in the form DDMM.mmm, as in NMEA"),
    "default": ("none | default(5)", "the value itself, or a replacement if the value is missing"),
    "degrees": ("0 | degrees", "angle in degrees, converted from radians"),
    "digits": (
        "'0102' | digits(2, 10)",
        "list of numbers, each read from a fixed number of digits",
    ),
    "exp": ("0 | exp", "exponential function"),
    "first": ("[4, 5] | first", "first element"),
    "fixed": ("2 | fixed(2)", "number with a fixed number of decimal places"),
    "float": ("'2.5' | float", "number parsed from text"),
    "floor": ("1.8 | floor", "number rounded down to a whole number"),
    "hex": ("255 | hex(4)", "hexadecimal digits, with leading zeros up to a width"),
    "hexbytes": ("'4f4b' | hexbytes", "bytes decoded from hexadecimal digits"),
    "hexdigits": ("'OK' | utf8 | hexdigits", "hexadecimal digits of bytes"),
    "hmac_sha256": ("'x' | hmac_sha256('key')", "keyed hash, for challenge-response logins"),
    "hypot": ("3 | hypot(4)", "length of a vector"),
    "int": ("'42' | int", "whole number parsed from text"),
    "iso": ("0 | iso", "time in ISO format, from seconds since 1970"),
    "join": ("[1, 2] | join(',')", "list joined into one text"),
    "last": ("[4, 5] | last", "last element"),
    "length": ("'abc' | length", "number of elements or characters"),
    "log": ("1 | log", "natural logarithm"),
    "lower": ("'ON' | lower", "lower-case letters"),
    "max": ("[4, 5] | max", "largest number"),
    "md5": ("'x' | md5", "MD5 hash, in hexadecimal digits"),
    "min": ("[4, 5] | min", "smallest number"),
    "numbers": ("'4f4b' | hexbytes | numbers('u8')", "list of numbers, decoded from bytes"),
    "pad": ("7 | pad(4)", "text padded on the left with zeros or another character"),
    "pick": (
        "[7, 8] | pick(['a', 'b'], ['b', 'a'])",
        "values of the named elements, from a list of values and a list of their names",
    ),
    "pitch": ("[0, 0, 0, 1] | pitch", "pitch of a quaternion [x, y, z, w], in radians"),
    "poses": (
        "[1] | poses([2])",
        "list of ROS poses, from lists of x, y and angles, stamped if a frame is named",
    ),
    "radians": ("0 | radians", "angle in radians, converted from degrees"),
    "ramp": ("0 | ramp(0.5, 3)", "list of numbers that increase by a fixed step"),
    "replace": ("'a-b' | replace('-', '_')", "text with replaced parts"),
    "roll": ("[0, 0, 0, 1] | roll", "roll of a quaternion [x, y, z, w], in radians"),
    "round": ("2.345 | round(1)", "rounded number"),
    "sha1": ("'x' | sha1", "SHA-1 hash, in hexadecimal digits"),
    "sha256": ("'x' | sha256", "SHA-256 hash, in hexadecimal digits"),
    "sign": ("1.5 | fixed(2) | sign", "number as text, with a sign even if it is positive"),
    "signed": ("255 | signed(8)", "signed value of a two's complement number"),
    "scan_points": (
        "[2, none] | scan_points(0, 0.5)",
        "x and y of the points of a laser scan in turn, from its distances, first angle and step",
    ),
    "sin": ("0 | sin", "sine of an angle in radians"),
    "split": ("'a,b' | split(',')", "list of the pieces of a text, split at a separator"),
    "sqrt": ("9 | sqrt", "square root"),
    "string": ("1.0 | string", "value converted to text"),
    "sum": ("[4, 5] | sum", "sum of numbers"),
    "tan": ("0 | tan", "tangent of an angle in radians"),
    "trim": ("' a ' | trim", "text without leading and trailing spaces"),
    "unpack": ("'0102' | hexbytes | unpack('u16be', 0)", "number decoded from bytes at an offset"),
    "upper": ("'on' | upper", "upper-case letters"),
    "utf8": ("'OK' | utf8", "text encoded as UTF-8 bytes"),
    "yaw": ("[0, 0, 0, 1] | yaw", "yaw of a quaternion [x, y, z, w], in radians"),
}
"""For each filter: an example expression, and the meaning of the filter's result."""
_OPERATORS = (
    ("`+` `-` `*` `/` `//` `%` `**`", "arithmetic; `+` also joins texts or bytes"),
    ("`'M ' ~ speed`", "text of both values, joined"),
    ("`==` `!=` `<` `<=` `>` `>=`", "comparisons"),
    ("`and` `or` `not`", "logic"),
    ("`x in [1, 2]`", "membership"),
    ("`'a' if test else 'b'`", "choice"),
    ("`x[0]` `x[1:3]`", "element and slice"),
    ("`x is defined` `x is none`", "whether a value exists; whether a value is `none`"),
    ("`x is number` `x is string`", "type"),
    (
        "`x is match('^E')` `x is search('E')`",
        "whether a pattern matches at the start of a text; whether it matches anywhere",
    ),
)


def page() -> str:
    """Return the page: operators, filters, number types."""
    lines = ["# Expressions and filters", ""]
    lines += [
        "Templates (`send:`) and expressions (`when:`, `set:`, `requires:`) use a subset of Jinja.",
        "Expressions have no loops, no statements and no access to Python.",
        "",
        "## Operators and tests",
        "",
    ]
    lines += table(("written", "meaning"), _OPERATORS)
    lines += ["## Filters", "", "URC computed the result of each example.", ""]
    for name, (example, meaning) in sorted(EXAMPLES.items()):
        result = compile_expression(example, allows_bytes=True).evaluate({})
        lines += [f"### {name}", "", f"{meaning[0].upper()}{meaning[1:]}.", ""]
        lines += [f"- arguments: {_arguments(name)}", f"- example: `{example}` is `{result!r}`", ""]
    numbers = ", ".join(f"`{name}`" for name in sorted(NUMBER_NAMES))
    lines += ["## Number types as filters", "", "Each number type is a filter that returns bytes:"]
    lines += [numbers + ".", ""]
    return "\n".join(lines).rstrip() + "\n"


def _arguments(name: str) -> str:
    least, most = FILTERS[name].arity
    return str(least) if least == most else f"{least} to {most}"

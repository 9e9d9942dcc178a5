"""A stand-in for the compiled part of `anycrc`: cyclic redundancy checks by a table.

Source: the Rocksoft model (Williams, A Painless Guide to CRC Error Detection Algorithms, 1993). The
tests compare the result of every model in the catalogue with its published check value, and with
`anycrc`.
"""

__all__ = ["CRC", "Model"]

_BYTE = 256


class CRC:
    """One CRC algorithm, with the parameters of the Rocksoft model."""

    def __init__(
        self,
        width: int,
        poly: int,
        init: int = 0,
        refin: bool = False,
        refout: bool = False,
        xorout: int = 0,
    ) -> None:
        """Prepare the table of the algorithm; `width` is in bits, 1 or more."""
        self.width = width
        self._mask = (1 << width) - 1
        self._refin, self._refout, self._xorout = refin, refout, xorout
        # A register of at least one byte: shorter registers are kept in its upper bits.
        self._shift = 0 if refin else max(0, 8 - width)
        self._size = width + self._shift
        if refin:
            self._start = _mirrored(init, width)
            self._table = _table_low(_mirrored(poly, width))
        else:
            self._start = init << self._shift
            self._table = _table_high(poly << self._shift, self._size)

    def calc(self, data: bytes) -> int:
        """Return the CRC of `data`."""
        register, table = self._start, self._table
        if self._refin:
            for byte in data:
                register = register >> 8 ^ table[(register ^ byte) & 0xFF]
        else:
            top, full = self._size - 8, (1 << self._size) - 1
            for byte in data:
                register = (register << 8 & full) ^ table[(register >> top ^ byte) & 0xFF]
            register >>= self._shift
        if self._refin != self._refout:
            register = _mirrored(register, self.width)
        return (register ^ self._xorout) & self._mask


def Model(name: str) -> CRC:  # noqa: N802  # the name in anycrc
    """Return the algorithm of a name in the catalogue; raise KeyError for an unknown name."""
    from anycrc.models import aliases, models

    upper = name.upper()
    return CRC(*models[aliases.get(upper, upper)][:6])


def _mirrored(value: int, bits: int) -> int:
    return int(f"{value:0{bits}b}"[::-1], 2)


def _table_low(poly: int) -> list[int]:
    """Return the register after each byte, for a register that is shifted to the right."""
    table = []
    for value in range(_BYTE):
        for _ in range(8):
            value = value >> 1 ^ (poly if value & 1 else 0)
        table.append(value)
    return table


def _table_high(poly: int, size: int) -> list[int]:
    """Return the register after each byte, for a register of `size` bits shifted to the left."""
    high, full = 1 << size - 1, (1 << size) - 1
    table = []
    for byte in range(_BYTE):
        value = byte << size - 8
        for _ in range(8):
            value = (value << 1 ^ (poly if value & high else 0)) & full
        table.append(value)
    return table

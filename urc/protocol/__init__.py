"""The protocol engine: decoding and encoding of bytes, without I/O or a clock."""

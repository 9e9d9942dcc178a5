"""Decoding and encoding of bytes, without I/O and without a clock."""

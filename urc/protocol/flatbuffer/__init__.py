"""Messages in FlatBuffers, read by their own schemas."""

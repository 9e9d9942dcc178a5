"""Messages in the Protocol Buffers format, read and written by their own schemas."""

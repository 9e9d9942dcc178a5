"""The HTTP API for programs: robots, signals, commands, motion under a lease, and recordings."""

"""The test rig: separate programs that emulate robots, operators and a network."""

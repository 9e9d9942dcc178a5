"""The test rig: separate programs that emulate robots, operators and the network between them."""

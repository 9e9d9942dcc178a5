"""The test rig: separate programs that play robots, operators and the network between them."""

"""Simulated servers: one for each kind of transport, through which clients reach the robot."""

"""Simulated servers that connect clients to an emulated robot, one for each type of transport."""

"""The motion contract as pure state machines: who may drive, for how long, and when it stops.

Floor 3, pure: no socket, no clock, no template; time is passed in, in seconds of one monotonic
clock. The guard process and the session run the same machines.
"""

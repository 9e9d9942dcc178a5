"""The motion contract as pure state machines: the lease of the operator, hold-to-run, and stops.

Floor 3, pure: no socket, no clock, no template; time is passed in, in seconds of one monotonic
clock. The guard process and the session run the same machines.
"""

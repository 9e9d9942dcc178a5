"""The motion rules as pure state machines: the operator's lease, hold-to-run controls, and stops.

This package is on layer 3 and is pure: no socket, no clock, no template. Callers pass the time, in
seconds of one monotonic clock. The guard process and the session use the same state machines.
"""

"""The motion rules as pure state machines: the operator's lease, hold-to-run controls, and stops.

Layer 3, pure. The package does not use sockets, clocks or templates. Callers pass the time in
seconds from one monotonic clock. The guard process and the session use the same state machines.
"""

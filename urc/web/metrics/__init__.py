"""Metrics for monitoring systems such as Prometheus, in the OpenMetrics format.

Layer 5. A request reads the current state. It connects to no robot and keeps no session open.
"""

"""Requests and replies on one connection: queue, rate limits, matching and timeouts."""

"""Requests and replies on one line: queue, rate limit, matching, timeouts."""

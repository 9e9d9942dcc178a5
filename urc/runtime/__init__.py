"""Runtime for robots: links, newest values and sessions."""

"""The operation of robots: links, newest values and sessions."""

"""The HTTP server and its access control."""

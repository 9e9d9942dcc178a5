"""Message types of the dashboard's sockets, without any logic."""

"""Message types of a dashboard's sockets, without behaviour."""

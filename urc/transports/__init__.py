"""The transports, one module per type. All sockets of robots are in this package."""

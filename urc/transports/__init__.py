"""The transports, one module per type. Only this package opens connections to robots."""

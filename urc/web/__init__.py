"""The dashboard: pages, one WebSocket a client, static modules."""

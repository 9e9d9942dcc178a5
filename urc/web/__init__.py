"""The dashboard: pages, static modules, and one WebSocket per page."""

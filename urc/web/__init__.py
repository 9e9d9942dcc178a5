"""The dashboard: pages, static modules, and one WebSocket for each page."""

"""The robots as topics and services for programs that speak the Foxglove WebSocket protocol."""

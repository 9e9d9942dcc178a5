"""The HTTP server underneath, and who may talk to it."""

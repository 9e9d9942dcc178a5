"""Public fakes for testing URC, third-party transports and third-party widgets."""

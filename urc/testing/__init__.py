"""Public fakes for tests of URC, of third-party transports and of third-party widgets."""

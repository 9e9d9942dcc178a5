"""Public fakes for tests of URC and of third-party transports and widgets."""

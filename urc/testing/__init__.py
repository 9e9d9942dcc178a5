"""Public fakes and helpers for tests of URC, third-party transports and third-party widgets."""

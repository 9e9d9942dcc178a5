"""Documents put together and written out: what extends, includes, params and each ask for."""

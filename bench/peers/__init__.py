"""Other dashboards with the same task, for `bench.browser_peers`."""

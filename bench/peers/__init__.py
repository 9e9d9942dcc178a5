"""Other dashboards for comparison with URC, used by `bench.browser_peers`."""

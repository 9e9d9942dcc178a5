"""Other dashboards on the same job, for `bench.browser_peers`."""

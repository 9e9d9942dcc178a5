"""Links from names in a model to their declarations."""

"""Links the names in a model to their declarations."""

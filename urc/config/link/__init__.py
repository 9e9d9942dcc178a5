"""Names in a model → what they refer to."""

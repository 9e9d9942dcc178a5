"""Rules about a whole profile."""

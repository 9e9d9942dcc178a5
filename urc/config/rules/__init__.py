"""Rules that check a complete profile."""

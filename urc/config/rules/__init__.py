"""Rules that check complete profiles."""

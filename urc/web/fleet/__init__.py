"""The served robots."""

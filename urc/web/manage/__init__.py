"""The manager pages: packages from repositories and the settings of robots."""

"""The managers: packages from repositories, and the settings of robots."""

"""The managers: packages got from repositories, and the settings of robots."""

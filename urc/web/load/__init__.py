"""Files that pages may load, as tables from URL to file."""

"""Running robots: links, newest values, sessions."""

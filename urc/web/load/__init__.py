"""What pages may load: looked up, never found."""

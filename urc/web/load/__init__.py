"""Tables that map URLs to the files that pages may load."""

"""Forms of a message on the wire: text, JSON, XML, hexadecimal and others."""

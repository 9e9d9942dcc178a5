"""The dev page of a robot: its traffic, a parser to try, what a command would send."""

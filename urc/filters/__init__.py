"""The filters of Jinja expressions, grouped by subject."""

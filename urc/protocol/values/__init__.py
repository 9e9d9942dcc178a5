"""Raw values to typed values, and back."""

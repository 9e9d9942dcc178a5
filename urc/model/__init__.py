"""What a document means, as frozen values."""

"""Sign-in over HTTP: the sign-in methods and people's requests to manage their own accounts."""

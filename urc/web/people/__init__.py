"""Sign-in over HTTP: the sign-in methods, and people's management of their own accounts."""

"""Sign-in over HTTP: the sign-in methods, and requests from people to manage their own accounts."""

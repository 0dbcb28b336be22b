"""Sign-in with second factors, and tokens."""

"""The door of the API: sign-in by token or browser session, bodies, answers, errors, the OpenAPI schema."""

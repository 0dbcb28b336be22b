"""The parts that all operations of the API share: sign-in by token or session, bodies, answers, errors, the schema."""

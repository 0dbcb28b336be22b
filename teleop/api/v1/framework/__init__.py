"""The parts that all operations of the API share: sign-in, scopes, bodies, answers, errors, the schema.

Programs sign in by a token, people by a token or their session.
"""

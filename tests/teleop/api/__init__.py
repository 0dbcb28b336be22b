"""The REST API: operations, schema, error codes, control by programs."""

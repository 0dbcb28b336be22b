"""Parts of the API that all operations share: access, idempotency, schema."""

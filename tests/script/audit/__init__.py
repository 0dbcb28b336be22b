"""The audit log while processes or databases fail, and on PostgreSQL."""

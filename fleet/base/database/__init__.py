"""The database under the models: rows of hand-written SQL, and whether its schema fits this code."""

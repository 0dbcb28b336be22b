"""Reading the audit log: its lists, the search, records in words, and exports."""

"""Reading the audit log: lists, search, texts about records, and exports."""

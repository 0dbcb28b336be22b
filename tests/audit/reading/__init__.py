"""The audit log for readers: lists, search, exports, wording."""

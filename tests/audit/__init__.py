"""The audit log: kinds, chain, triggers, search, lists, exports, verification, retention."""

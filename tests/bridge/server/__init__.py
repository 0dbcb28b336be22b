"""The link's server and its lane."""

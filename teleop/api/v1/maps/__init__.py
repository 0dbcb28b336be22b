"""Maps that robots share, and their named places."""

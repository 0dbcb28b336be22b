"""The losses by a change: who loses which booking, shown before it is done; letters; undo for a day."""

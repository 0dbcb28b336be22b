"""What a change takes from people: who loses which booking, shown before it is done; letters; undo for a day."""

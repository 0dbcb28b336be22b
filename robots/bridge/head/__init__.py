"""Where the head looks: by its holder, ahead, into the turn of a drive."""

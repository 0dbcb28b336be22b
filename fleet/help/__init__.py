"""Help: the pages of docs/, rendered in the console's look, so that nobody needs the internet or the repository."""

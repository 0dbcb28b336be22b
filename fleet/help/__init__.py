"""Help: the pages of docs/ in the console's style, so that nobody needs the internet or the repository."""

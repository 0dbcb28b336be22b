"""Pages of no app, and parts of every page: header, errors, first run, cookies, privacy, health, the installed app."""

"""Parts that every app uses: names, time zones, addresses, settings from the environment. They know no app."""

"""People: accounts, signing in and out, where somebody is signed in."""

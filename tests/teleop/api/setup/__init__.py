"""Set-up at the API."""

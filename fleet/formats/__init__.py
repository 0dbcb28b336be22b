"""How moments and numbers are written where a page leaves that to Django, by language."""

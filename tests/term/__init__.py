"""A teacher's whole term through the pages, and how many actions it takes."""

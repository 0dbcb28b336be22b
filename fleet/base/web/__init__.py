"""Requests and answers, for every app: addresses of clients and of the console, ids, ranges, pages of a list."""

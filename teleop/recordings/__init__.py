"""Recordings for people: who sees which part, sharing, deletion, pages and downloads."""

"""The addresses of the pages about error codes, for parts of the console that know no URLs of Django."""


def error_page(code: str) -> str:
    """Return the address of the page about a code, below the address of the console."""
    return f"/help/errors/{code}/"

"""Numbers as they are written everywhere in the window."""


def format_count(number: int) -> str:
    """A count with thousands apart: 4,320."""
    return f"{number:,}"

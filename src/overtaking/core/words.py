"""Numbers in sentences."""


def counted(number: int, noun: str) -> str:
    """A number with its noun.

    Args:
        number: How many.
        noun: What, in the singular, with a plural in s.

    Examples:
        >>> counted(1, "simulation"), counted(1000, "simulation")
        ('1 simulation', '1,000 simulations')
    """
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"

"""Refusals of numbers that cannot be used."""

from overtaking.core.errors import ConfigError


def at_least_one(what: str, number: int) -> None:
    """Refuse a number below 1.

    Raises:
        ConfigError: It is.
    """
    if number < 1:
        raise ConfigError.of(
            what=what,
            where="learn",
            expected="1 or more",
            got=number,
            next_step="choose a number in that range",
        )

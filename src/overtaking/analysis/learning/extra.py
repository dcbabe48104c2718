"""The optional library of models, and one thread for it."""

from collections.abc import Generator
from contextlib import contextmanager
from importlib.util import find_spec

from overtaking.core.errors import MissingExtraError


def require_models() -> None:
    """Refuse to go on without scikit-learn.

    Raises:
        MissingExtraError: It is not installed.
    """
    if find_spec("sklearn") is None:
        raise MissingExtraError.lacking(
            "learn", what="scikit-learn, which fits models", where="learn"
        )


@contextmanager
def one_thread() -> Generator[None]:
    """Compute in one thread: sums in another order would be other models in the last digits."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):
        yield

# pyarrow ships no types and makes much of `compute` at run time. To the type checker it is Any, so
# that code around it is checked strictly and code that uses it is held by tests.
from typing import Any

def __getattr__(name: str) -> Any: ...

"""Array types, each with its dtype.

An annotation states its dtype beside the type, where `model.batch.declared_dtype` reads it. The
dtype cannot be read from `NDArray[np.uint8]`, which is a generic alias before NumPy 2.5 on Python
3.12, and a type alias since.
"""

from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

F32 = Annotated[NDArray[np.floating[Any]], np.dtype(np.float32)]
"""A float32 array. Type checkers see an array of any float: in NumPy's own types the width is lost
after one operation, so that they would report errors in correct code."""
F64 = Annotated[NDArray[np.float64], np.dtype(np.float64)]
I16 = Annotated[NDArray[np.int16], np.dtype(np.int16)]
I32 = Annotated[NDArray[np.int32], np.dtype(np.int32)]
I64 = Annotated[NDArray[np.int64], np.dtype(np.int64)]
U8 = Annotated[NDArray[np.uint8], np.dtype(np.uint8)]
U32 = Annotated[NDArray[np.uint32], np.dtype(np.uint32)]
U64 = Annotated[NDArray[np.uint64], np.dtype(np.uint64)]
Mask = Annotated[NDArray[np.bool_], np.dtype(np.bool_)]
IndexArray = Annotated[NDArray[np.intp], np.dtype(np.intp)]

F32Like = F32 | np.floating[Any]
"""A float32 array or number."""

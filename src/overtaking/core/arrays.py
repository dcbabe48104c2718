"""Array types, each with its dtype.

NumPy decides what `NDArray[np.uint8]` is at run time: a generic alias before NumPy 2.5 on Python
3.12, a type alias since. An annotation therefore states its dtype beside the type, and
`model.values` reads it there.
"""

from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

F32 = Annotated[NDArray[np.floating[Any]], np.dtype(np.float32)]
"""A float32 array. Type checkers see an array of any float: NumPy's own types lose the width after
one operation, and would refuse right code."""
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

"""Cells of ascending places, compiled: plain loops, which compile in a tenth of NumPy's time."""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.kernels import kernel


@kernel(nogil=True)
def cell_at(starts: Array, count: int, value: float, last: int) -> int:
    """Which of ``count`` cells that begin at ``starts`` holds a value, the outer ones also what lies
    beyond; looked for from the cell ``last`` on, as values usually ascend."""
    low, high = 0, count
    if starts[last] <= value:
        if last + 1 >= count or value < starts[last + 1]:
            return last
        if last + 2 >= count or value < starts[last + 2]:
            return last + 1
        low = last + 1
    else:
        high = last
    while high - low > 1:
        middle = (low + high) // 2
        if starts[middle] <= value:
            low = middle
        else:
            high = middle
    return low


@kernel(nogil=True)
def longer(values: Array) -> Array:
    """(2 N,): an array that starts with ``values`` (N,)."""
    found = np.empty(2 * len(values))
    for k in range(len(values)):
        found[k] = values[k]
    return found


@kernel(nogil=True)
def longer_indices(values: IndexArray) -> IndexArray:
    """(2 N,): an array that starts with ``values`` (N,)."""
    found = np.empty(2 * len(values), dtype=np.intp)
    for k in range(len(values)):
        found[k] = values[k]
    return found

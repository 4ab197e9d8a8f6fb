"""Products of matrices whose bits do not depend on how many threads BLAS has.

OpenBLAS shares out what is large among its threads, which changes the order of sums. These products are cut
into pieces that it leaves to one thread; a matrix times a vector is left to NumPy.
"""

import numpy as np

from sms_handover.types import Array

_MOST = 200_000  # [-] multiplications of a piece; OpenBLAS uses threads from 262144 on


def product(a: Array, b: Array) -> Array:
    """Return a b (r, c) of a (r, k) and b (k, c), in pieces of some columns."""
    rows, inner = a.shape
    found, wide = np.empty((rows, b.shape[1])), max(1, _MOST // (rows * inner))
    for first in range(0, b.shape[1], wide):
        found[:, first : first + wide] = a @ b[:, first : first + wide]
    return found


def times_vector(a: Array, x: Array) -> Array:
    """Return a x (r,) of a (r, k) and x (k,)."""
    return np.asarray(np.einsum("rk,k->r", a, x))

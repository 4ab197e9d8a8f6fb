"""C functions as CasADi generates them, called on arrays of the caller."""

import ctypes
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sms_handover.errors import ConfigurationError
from sms_handover.types import Array

_SIZES = 4  # sizes reported by a generated function: arguments, results, integer and real work space


class CFunction:
    """A function of a shared library, bound to its arguments and results.

    Each call reads ``arguments`` and writes ``results`` in place; both are kept alive with the function. The
    GIL is not released: a call takes microseconds.
    """

    def __init__(
        self, library: Path, name: str, arguments: Sequence[Array], results: Sequence[Array]
    ) -> None:
        """Load the library; raises ConfigurationError if it has no such function."""
        try:
            loaded = ctypes.PyDLL(str(library))
            call, work_space = loaded[name], loaded[f"{name}_work"]
        except (OSError, AttributeError) as error:
            raise ConfigurationError(f"cannot load {library}: {error}; remove the file") from error
        sizes = [ctypes.c_longlong() for _ in range(_SIZES)]
        work_space(*(ctypes.byref(size) for size in sizes))
        n_arguments, n_results, _, n_work = (size.value for size in sizes)
        work = np.zeros(max(1, n_work))
        self._kept = (*arguments, *results, work)
        self._call = call
        self._arguments = (ctypes.c_void_p * n_arguments)(*(array.ctypes.data for array in arguments))
        self._results = (ctypes.c_void_p * n_results)(*(array.ctypes.data for array in results))
        self._work = ctypes.c_void_p(work.ctypes.data)

    def __call__(self) -> None:
        """Compute the results of the present arguments."""
        self._call(self._arguments, self._results, None, self._work, 0)

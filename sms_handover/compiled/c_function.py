"""C functions of a library, as CasADi generates them and as they are written, on arrays of the caller."""

import ctypes
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from sms_handover.compiled.names import WORK_SIZE
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
        call, work_space = (_loaded(library, each) for each in (name, f"{name}_work"))
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


class NativeFunction:
    """A function of a shared library that is written in C; its last pointer is to work space of its own.

    Arguments are addresses of arrays, or whole numbers. The GIL is not released.
    """

    def __init__(self, library: Path, name: str, kinds: Sequence[type], other: Path | None = None) -> None:
        """Load the library; raises ConfigurationError if it has no such function.

        ``kinds`` are the types of the arguments before the work space: ``ctypes.c_void_p`` or ``c_long``. The
        work space is enough for functions of an ``other`` library too, whose addresses may be passed on.
        """
        self._call = _loaded(library, name)
        self._call.argtypes = [*kinds, ctypes.c_void_p]
        self._call.restype = ctypes.c_long
        sizes = [ctypes.c_longlong.in_dll(_opened(path), WORK_SIZE) for path in (library, other or library)]
        self._kept = np.zeros(max(size.value for size in sizes))
        self._work = self._kept.ctypes.data

    def __call__(self, *arguments: int | None) -> int:
        """Call the function; what it returns means nothing where it is void."""
        found: int = self._call(*arguments, self._work)
        return found


def address_of(library: Path, name: str) -> int:
    """Return where a function of a library is, to be passed on; raises ConfigurationError."""
    address = ctypes.cast(_loaded(library, name), ctypes.c_void_p).value
    assert address is not None
    return address


def _loaded(library: Path, name: str) -> Any:
    """Return a function of a library; raises ConfigurationError if there is none."""
    try:
        return _opened(library)[name]
    except (OSError, AttributeError) as error:
        raise ConfigurationError(f"cannot load {library}: {error}; remove the file") from error


@cache
def _opened(library: Path) -> ctypes.PyDLL:
    """Return an open library: that takes a millisecond, and a payload that changes asks a dozen times."""
    return ctypes.PyDLL(str(library))

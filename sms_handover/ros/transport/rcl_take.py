"""Takes of rcl: serialized messages with the identity of their publisher, which rclpy does not hand on.

rclpy 7.1 tells when a message was sent, but not by whom. rcl below it knows both, so it is called directly,
by the public functions and structures of its C interface, which are the same from Humble on. That costs no
more than rclpy's own way.
"""

from collections.abc import Callable
from ctypes import (
    PyDLL,
    Structure,
    byref,
    c_char_p,
    c_int,
    c_int64,
    c_size_t,
    c_uint8,
    c_uint64,
    c_void_p,
    string_at,
)
from functools import cache
from typing import Any

from rclpy.subscription import Subscription
from rclpy.utilities import get_rmw_implementation_identifier

from sms_handover.errors import ConfigurationError, GraphError

IDENTITY = 16  # [byte] of a publisher's global identifier

# Whether messages and discovery name a publisher alike; other middlewares have identifiers of their own.
IDENTIFIES = get_rmw_implementation_identifier().startswith("rmw_fastrtps")

_NOTHING_THERE = 401  # RCL_RET_SUBSCRIPTION_TAKE_FAILED, rcl/types.h
_CAPACITY = 1024  # [byte] to begin with; rcl makes it as large as a message takes


class _Allocator(Structure):
    """rcutils_allocator_t of rcutils/allocator.h."""

    _fields_ = [(name, c_void_p) for name in ("allocate", "deallocate", "reallocate", "zero", "state")]


class _Bytes(Structure):
    """rcutils_uint8_array_t of rcutils/types/uint8_array.h."""

    _fields_ = [
        ("buffer", c_void_p),
        ("length", c_size_t),
        ("capacity", c_size_t),
        ("allocator", _Allocator),
    ]


class _Info(Structure):
    """rmw_message_info_t of rmw/types.h; the end has room for what other versions keep there."""

    _fields_ = [
        ("sent_ns", c_int64),
        ("received_ns", c_int64),
        ("number_sent", c_uint64),
        ("number_received", c_uint64),
        ("implementation", c_char_p),
        ("publisher", c_uint8 * IDENTITY),
        ("rest", c_uint8 * 64),
    ]


class SerializedTaker:
    """Takes the messages of one subscription, which nothing else may take from; close it."""

    def __init__(self, subscription: Subscription) -> None:
        """Take from a subscription; raises ConfigurationError if rcl cannot be called."""
        library = _library()
        self._rcl_take: Callable[..., int] = library.take
        self._subscription = subscription  # which has to live as long as its address is used
        self._bytes, self._info = _Bytes(), _Info()
        if library.init(byref(self._bytes), _CAPACITY, byref(library.allocator)):
            raise GraphError("there is no memory for a message")
        self._give_back = library.fini
        handle: Any = subscription.handle
        self._arguments = c_void_p(handle.pointer), byref(self._bytes), byref(self._info), None

    def take(self) -> tuple[bytes, int, bytes] | None:
        """Return the next message, None if nothing has come; raises GraphError if rcl cannot take.

        It is the CDR bytes, the wall time of their sending in ns (0 if not known), and the global
        identifier of their publisher as discovery has it (b"" where :data:`IDENTIFIES` is false).
        """
        code = self._rcl_take(*self._arguments)
        if code:
            if code == _NOTHING_THERE:
                return None
            raise GraphError(f"no message can be taken: error {code} of rcl")
        taken, info = self._bytes, self._info
        publisher = bytes(info.publisher) if IDENTIFIES else b""
        return string_at(taken.buffer, taken.length), info.sent_ns, publisher

    def close(self) -> None:
        """Give the memory back; nothing can be taken any more."""
        self._rcl_take = lambda *arguments: _NOTHING_THERE
        self._give_back(byref(self._bytes))


class _Library:
    """The functions of the libraries that rclpy has loaded; raises OSError where they have other names."""

    def __init__(self) -> None:
        rcl, rcutils = PyDLL("librcl.so"), PyDLL("librcutils.so")
        self.take = rcl.rcl_take_serialized_message
        self.init, self.fini = rcutils.rcutils_uint8_array_init, rcutils.rcutils_uint8_array_fini
        self.take.argtypes, self.take.restype = (c_void_p,) * 4, c_int
        self.init.argtypes, self.init.restype = (c_void_p, c_size_t, c_void_p), c_int
        self.fini.argtypes, self.fini.restype = (c_void_p,), c_int
        rcutils.rcutils_get_default_allocator.restype = _Allocator
        self.allocator = rcutils.rcutils_get_default_allocator()


@cache
def _library() -> _Library:
    """Return the functions; raises ConfigurationError where they are not to be found."""
    try:
        return _Library()
    except (OSError, AttributeError) as error:
        text = f"transport 'direct' needs librcl.so, which cannot be used here ({error}); take 'executor'"
        raise ConfigurationError(text) from error

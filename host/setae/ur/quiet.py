"""ur-rtde's own messages, kept out of the terminal.

Its threads print five lines about a lost connection, whatever it is told, and setae's error
says it better. File descriptors are left alone: a crash can still be told, and so can
everything that Python prints.
"""

from __future__ import annotations

import ctypes
from typing import Final

__all__ = ["silence"]

# Symbols of GNU's C++ library, and the layout of its streams: the Itanium C++ ABI, which the
# library's name (.so.6) promises. Elsewhere the lines are printed.
_LIBRARY: Final = "libstdc++.so.6"
_CLEAR: Final = "_ZNSt9basic_iosIcSt11char_traitsIcEE5clearESt12_Ios_Iostate"
_STREAMS: Final = ("_ZSt4cerr", "_ZSt4cout")
_BADBIT: Final = 1
_VIRTUAL_BASE_WORDS: Final = 3  # before the table of virtual functions: where std::ios begins


def silence() -> None:
    """Have std::cerr and std::cout of this process take nothing."""
    try:
        library = ctypes.CDLL(_LIBRARY)
        clear = library[_CLEAR]
        streams = [ctypes.c_void_p.in_dll(library, name) for name in _STREAMS]
    except (AttributeError, OSError, ValueError):
        return
    clear.argtypes, clear.restype = (ctypes.c_void_p, ctypes.c_int), None
    for stream in streams:
        assert stream.value is not None
        offset_at = stream.value - _VIRTUAL_BASE_WORDS * ctypes.sizeof(ctypes.c_void_p)
        offset = ctypes.c_ssize_t.from_address(offset_at).value
        clear(ctypes.addressof(stream) + offset, _BADBIT)

"""Sleeping on a word of a read-only mapping, as the kernel offers it (futex(2))."""

from __future__ import annotations

import ctypes
import mmap
import platform
import time

_SYSTEM_CALLS = {"x86_64": 202, "aarch64": 98}
_FUTEX_WAIT = 0
_LONGEST_POLL_S = 0.001


class _Timespec(ctypes.Structure):
    _fields_ = [("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long)]


class _Buffer(ctypes.Structure):
    """``Py_buffer`` of CPython."""

    _fields_ = [
        ("address", ctypes.c_void_p),
        ("owner", ctypes.c_void_p),
        ("length", ctypes.c_ssize_t),
        ("item_size", ctypes.c_ssize_t),
        ("read_only", ctypes.c_int),
        ("dimensions", ctypes.c_int),
        ("format", ctypes.c_char_p),
        ("shape", ctypes.c_void_p),
        ("strides", ctypes.c_void_p),
        ("suboffsets", ctypes.c_void_p),
        ("internal", ctypes.c_void_p),
    ]


class Futex:
    """The 32-bit word at ``offset`` bytes of ``mapping``, to be waited on.

    Where there is no such system call (another processor, another Python than CPython) it polls every millisecond.
    """

    def __init__(self, mapping: mmap.mmap, offset: int, word: memoryview) -> None:
        """``word``: the same word as a memoryview of one item of format ``I``."""
        self._mapping = mapping
        self._word = word
        self._address: int | None = None
        number = _SYSTEM_CALLS.get(platform.machine())
        if number is None or platform.python_implementation() != "CPython":
            return
        # ctypes takes the address of writable buffers only; the buffer protocol tells that of any.
        buffer = _Buffer()
        ctypes.pythonapi.PyObject_GetBuffer(ctypes.py_object(mapping), ctypes.byref(buffer), 0)
        self._address = buffer.address + offset
        # The memoryview keeps the mapping where it is, so the address stays good without this buffer.
        ctypes.pythonapi.PyBuffer_Release(ctypes.byref(buffer))
        self._number = number
        self._system_call = ctypes.CDLL(None, use_errno=True).syscall
        self._system_call.restype = ctypes.c_long

    def value(self) -> int:
        """What the word holds now."""
        return self._word[0]

    def wait(self, value: int, timeout_s: float) -> None:
        """Sleeps while the word is ``value``, at most ``timeout_s``. May return earlier."""
        if self._address is None:
            end = time.monotonic() + timeout_s
            while self._word[0] == value and (left := end - time.monotonic()) > 0:
                time.sleep(min(left, _LONGEST_POLL_S))
            return
        nanoseconds = max(0, int(timeout_s * 1e9))
        timeout = _Timespec(nanoseconds // 1_000_000_000, nanoseconds % 1_000_000_000)
        # Woken, timed out, interrupted, or the word was another one: all mean "look again".
        self._system_call(
            ctypes.c_long(self._number),
            ctypes.c_void_p(self._address),
            ctypes.c_int(_FUTEX_WAIT),
            ctypes.c_uint32(value),
            ctypes.byref(timeout),
            None,
            ctypes.c_uint32(0),
        )

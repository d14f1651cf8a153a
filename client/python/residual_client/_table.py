"""The bounds table of one life of a daemon, mapped read-only.

Memory ordering
---------------
The daemon writes whole 64-bit words atomically. ``memoryview`` items of the format ``Q`` are read by CPython as one
aligned 8-byte load each, so no word is ever torn. CPython has no fence of its own: on x86-64, which keeps loads in
order, none is needed; elsewhere :func:`_fence` gives back and takes again a lock, whose atomic release and acquire
keep the loads before it before the loads behind it. What was overtaken by the daemon is recognised by the sequence
word and read again, as in every other language.
"""

from __future__ import annotations

import mmap
import os
import platform
import struct
import threading
from dataclasses import dataclass
from typing import List, Optional, Tuple, Union

from . import _layout as L
from ._futex import Futex
from .records import Channel, ChannelName, Diagnoser, StepRecord

_MASK = 0xFFFF_FFFF_FFFF_FFFF
_LOW = 0xFFFF_FFFF


class TableError(Exception):
    """The bounds table cannot be used."""


class NoTable(TableError):
    """There is no bounds table: the daemon has not been started, or has another name or directory."""


class NotPermitted(TableError):
    """This user may not read the bounds table."""


class OtherLayout(TableError):
    """The daemon is of a release with another layout."""


class Damaged(TableError):
    """The file is damaged, or no bounds table."""


class Overtaken(TableError):
    """The daemon overtook every attempt to read; try again."""


@dataclass(frozen=True)
class AlarmWords:
    """An alarm transition as it lies in the ring, without names."""

    number: int
    epoch: int
    written_ns: int
    instant_ns: int
    step: int
    slot: int
    state: int
    verdict: int
    flags: int
    occurrence: int
    certainly_faulty: int
    possibly_faulty: int
    channel: int
    ratio: float
    fault_estimate: float
    fault_estimate_half_width: float


#: What a look at one number of the alarm ring gave.
WAITING, LOST = "waiting", "lost"
AlarmLook = Union[str, AlarmWords]

if platform.machine() == "x86_64":

    def _fence() -> None:
        """Loads stay in order by themselves."""

else:
    _lock = threading.local()

    def _fence() -> None:
        """Keeps the loads before it before the loads behind it."""
        lock = getattr(_lock, "lock", None)
        if lock is None:
            lock = _lock.lock = threading.Lock()
            lock.acquire()
        lock.release()
        lock.acquire()


def _floats(words: List[int]) -> Tuple[float, ...]:
    return struct.unpack(f"={len(words)}d", struct.pack(f"={len(words)}Q", *words))


def _checksum(words: List[int]) -> int:
    value = L.FNV_START
    for word in words:
        value = ((value ^ word) * L.FNV_PRIME) & _MASK
        value ^= value >> 32
    return value


def _boot_id() -> int:
    try:
        with open("/proc/sys/kernel/random/boot_id", encoding="ascii") as file:
            return int(file.read().strip().replace("-", ""), 16)
    except (OSError, ValueError):
        return 0


class Table:
    """The bounds table of one life of a daemon."""

    def __init__(self, path: str) -> None:
        """Opens and checks the table at ``path``.

        :raises TableError: one of its subclasses says what is wrong.
        """
        self.path = path
        try:
            descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        except FileNotFoundError:
            raise NoTable(f"there is no bounds table at {path}; is the daemon running, with this instance name and "
                          "runtime directory?") from None
        except PermissionError:
            raise NotPermitted(f"the bounds table {path} may not be read by this user; become a member of its "
                               "group") from None
        except OSError as error:
            raise TableError(f"cannot open the bounds table {path}: {error}") from error
        try:
            status = os.fstat(descriptor)
            size = status.st_size // L.WORD_BYTES * L.WORD_BYTES
            if size < L.HEADER_WORDS * L.WORD_BYTES:
                raise Damaged(f"{path} is not a bounds table of residuald: it has only {status.st_size} bytes")
            self._mapping = mmap.mmap(descriptor, size, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            raise Damaged(f"{path} is not a bounds table of residuald: {error}") from error
        finally:
            os.close(descriptor)
        self._file = (status.st_dev, status.st_ino)
        self._words = memoryview(self._mapping).cast("Q")
        self._check_head(size)
        try:
            self._decode()
        except (IndexError, UnicodeDecodeError, ValueError) as error:
            raise Damaged(f"the directory of the bounds table {path} is damaged: {error}; restart the daemon") from error
        wake = (self._ring + L.ALARM_RING_WAKE) * L.WORD_BYTES
        word = memoryview(self._mapping)[wake : wake + 4].cast("I")
        self._futex = Futex(self._mapping, wake, word)

    def _check_head(self, size: int) -> None:
        words, path = self._words, self.path
        if words[L.HEADER_MAGIC] != L.MAGIC:
            raise Damaged(f"{path} is not a bounds table of residuald: it does not begin with `RESIDUAL`")
        found = (words[L.HEADER_VERSION], words[L.HEADER_HASH])
        if found != (L.VERSION, L.HASH):
            raise OtherLayout(f"the bounds table {path} has the layout {found[0]} ({found[1]:016x}), this program reads "
                              f"the layout {L.VERSION} ({L.HASH:016x}); use the client of the daemon's release")
        total = words[L.HEADER_TOTAL_BYTES]
        if total > size:
            raise Damaged(f"the bounds table {path} is cut off: it has {size} of {total} bytes; restart the daemon")

    def _decode(self) -> None:
        count = self._words[L.HEADER_DIRECTORY_BYTES] // L.WORD_BYTES
        if not L.HEADER_WORDS <= count <= len(self._words):
            raise ValueError("its size is wrong")
        # Checked and used is a private copy, which nobody can change in between.
        words = self._words[:count].tolist()
        checked = list(words)
        for field in (L.HEADER_CHECKSUM, L.HEADER_STATE, L.HEADER_HEARTBEAT):
            checked[field] = 0
        if _checksum(checked) != words[L.HEADER_CHECKSUM]:
            raise ValueError("its checksum is wrong")
        data = struct.pack(f"={count}Q", *words)

        def text(index: int) -> str:
            offset, length = words[index] & _LOW, words[index] >> 32
            if offset + length > len(data):
                raise ValueError("a text lies outside of it")
            return data[offset : offset + length].decode()

        def texts(index: int, number: int) -> List[str]:
            first = words[index] // L.WORD_BYTES
            return [text(first + i) for i in range(number)]

        self.instance = text(L.HEADER_INSTANCE)
        self.pid: int = words[L.HEADER_PID]
        self.epoch: int = words[L.HEADER_EPOCH]
        self.alarm_origin: int = words[L.HEADER_ALARM_ORIGIN]
        self.alarm_capacity: int = words[L.HEADER_ALARM_CAPACITY]
        self.stale_after_periods: int = words[L.HEADER_STALE_AFTER_PERIODS]
        self._time_origin_ns: int = words[L.HEADER_TIME_ORIGIN_NS]
        (self._time_speed,) = _floats([words[L.HEADER_TIME_SPEED]])
        boot = words[L.HEADER_BOOT_ID_LOW] | words[L.HEADER_BOOT_ID_HIGH] << 64
        self._earlier_boot = 0 not in (boot, _boot_id()) and boot != _boot_id()
        self._ring = words[L.HEADER_ALARM_RING] // L.WORD_BYTES
        self.diagnosers: List[Diagnoser] = []
        self._slots: List[int] = []
        self._cells: List[int] = []
        self._statuses: List[int] = []
        for index in range(words[L.HEADER_SLOT_COUNT]):
            entry = words[L.HEADER_SLOT_ENTRIES] // L.WORD_BYTES + index * L.SLOT_ENTRY_WORDS
            names = texts(entry + L.SLOT_ENTRY_CHANNELS, 2 * words[entry + L.SLOT_ENTRY_CHANNEL_COUNT])
            self.diagnosers.append(Diagnoser(
                name=text(entry + L.SLOT_ENTRY_NAME),
                method=text(entry + L.SLOT_ENTRY_METHOD),
                period_ns=words[entry + L.SLOT_ENTRY_PERIOD_NS],
                phase_ns=words[entry + L.SLOT_ENTRY_PHASE_NS],
                margin_ns=words[entry + L.SLOT_ENTRY_MARGIN_NS],
                channels=[ChannelName(*pair) for pair in zip(names[::2], names[1::2])],
                faults=texts(entry + L.SLOT_ENTRY_FAULTS, words[entry + L.SLOT_ENTRY_FAULT_COUNT]),
            ))
            self._slots.append(words[entry + L.SLOT_ENTRY_SLOT] // L.WORD_BYTES)
            self._cells.append(words[entry + L.SLOT_ENTRY_CELL_BYTES] // L.WORD_BYTES)
            self._statuses.append(words[entry + L.SLOT_ENTRY_ALARM] // L.WORD_BYTES)
        ends = [slot + L.LINE_WORDS + 2 * cell for slot, cell in zip(self._slots, self._cells)]
        ends.append(self._ring + L.ALARM_RING_ENTRIES + self.alarm_capacity * L.ALARM_WORDS)
        if max(ends) > len(self._words) or self.alarm_capacity == 0:
            raise ValueError("its slots lie outside the file")

    def slot_of(self, name: str) -> Optional[int]:
        """Index of the diagnoser ``name``."""
        return next((i for i, one in enumerate(self.diagnosers) if one.name == name), None)

    def time_ns(self, monotonic_ns: int) -> int:
        """The daemon's time at a moment of CLOCK_MONOTONIC, nanoseconds."""
        if self._time_speed == 1.0:
            return monotonic_ns
        elapsed = max(0, monotonic_ns - self._time_origin_ns)
        return self._time_origin_ns + int(elapsed * self._time_speed)

    def is_closed(self) -> bool:
        """Whether the daemon has ended in good order, or before the machine's last boot."""
        return self._earlier_boot or self._words[L.HEADER_STATE] != L.STATE_RUNNING

    def is_running(self, monotonic_ns: int) -> bool:
        """Whether the daemon gave a sign of life of late."""
        return not self.is_closed() and monotonic_ns - self._words[L.HEADER_HEARTBEAT] <= L.HUNG_AFTER_NS

    def is_replaced(self) -> bool:
        """Whether the path leads to another file by now: the daemon has been started again."""
        try:
            status = os.stat(self.path)
        except OSError:
            return False
        return (status.st_dev, status.st_ino) != self._file

    def read(self, slot: int) -> Tuple[int, Optional[StepRecord]]:
        """The newest record of a diagnoser and its number; 0 and None before the first one.

        :raises Overtaken: the daemon writes faster than Python reads.
        """
        words, start, cell = self._words, self._slots[slot], self._cells[slot]
        length = L.RECORD_HEAD_WORDS + L.CHANNEL_WORDS * len(self.diagnosers[slot].channels)
        for _ in range(L.READ_ATTEMPTS):
            number = words[start]
            if number == 0:
                return 0, None
            _fence()
            first = start + L.LINE_WORDS + (number & 1) * cell
            copy = words[first : first + length].tolist()
            _fence()
            if words[start] == number:
                return number, _record(copy)
        raise Overtaken(f"the daemon overtook {L.READ_ATTEMPTS} attempts to read slot {slot}; try again")

    def alarm_status(self, slot: int) -> dict[str, int]:
        """Where the alarm of a diagnoser stands, by the names of ``AlarmStatus``."""
        start = self._statuses[slot]
        return {name: self._words[start + i] for i, name in enumerate(L.ALARM_STATUS)}

    def newest_alarm(self) -> int:
        """Number of the newest alarm transition; 0: there has not been any."""
        return self._words[self._ring + L.ALARM_RING_NEWEST]

    def read_alarm(self, number: int) -> AlarmLook:
        """The alarm transition with this number, or why there is none: WAITING or LOST."""
        if number > self.newest_alarm():
            return WAITING
        _fence()
        if number < 1:
            return LOST
        place = (number - 1) % self.alarm_capacity
        first = self._ring + L.ALARM_RING_ENTRIES + place * L.ALARM_WORDS
        if self._words[first] != number:
            return LOST
        _fence()
        copy = self._words[first : first + L.ALARM_WORDS].tolist()
        _fence()
        if copy[0] != number or self._words[first] != number:
            return LOST
        return _alarm(copy)

    def wait_for_alarm(self, seen: int, timeout_s: float) -> None:
        """Sleeps until there is a transition above ``seen``, at most ``timeout_s``; may return earlier."""
        # Not the low half of `seen`: a daemon that was killed between the newest number and the futex has left that
        # behind, and a sleep on a value that the futex does not hold is over at once.
        value = self._futex.value()
        _fence()
        if self.newest_alarm() == seen:
            self._futex.wait(value, timeout_s)


def _record(words: List[int]) -> StepRecord:
    body = _floats(words[L.RECORD_HEAD_WORDS :])
    estimate, half_width = _floats(words[5:7])
    count = min(words[8] >> 32, len(body) // L.CHANNEL_WORDS)
    return StepRecord(
        step=words[0],
        instant_ns=words[1],
        certainly_faulty=words[2],
        possibly_faulty=words[3],
        inputs_valid=words[4],
        fault_estimate=estimate,
        fault_estimate_half_width=half_width,
        verdict_number=words[7] & _LOW,
        flags=words[7] >> 32,
        skipped_instants=words[8] & _LOW,
        channels=[Channel(*body[4 * i : 4 * i + 4]) for i in range(count)],
    )


def _alarm(words: List[int]) -> AlarmLook:
    if words[6] >> 32 >= len(L.ALARM_STATES):
        return LOST
    ratio, estimate, half_width = _floats(words[12:15])
    return AlarmWords(
        number=words[0],
        epoch=words[1],
        written_ns=words[2],
        instant_ns=words[3],
        step=words[4],
        slot=words[6] & _LOW,
        state=words[6] >> 32,
        verdict=words[7] & _LOW,
        flags=words[7] >> 32,
        occurrence=words[8],
        certainly_faulty=words[9],
        possibly_faulty=words[10],
        channel=words[11] & _LOW,
        ratio=ratio,
        fault_estimate=estimate,
        fault_estimate_half_width=half_width,
    )

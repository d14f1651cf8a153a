"""Hearing every alarm transition once."""

from __future__ import annotations

import time
from dataclasses import dataclass
from enum import IntEnum
from typing import List, NamedTuple, Optional, Union

from ._latest import RETRY_PERIOD_S, LatestTable, table_path
from ._table import LOST, AlarmWords, NoTable, Table, TableError
from .records import Diagnoser, Verdict

#: Longest sleep before the listener looks whether the daemon still lives: one that was killed wakes nobody.
_LONGEST_SLEEP_S = 0.1


class AlarmState(IntEnum):
    """Where the alarm of one diagnoser stands."""

    CLEARED = 0
    PENDING = 1
    RAISED = 2
    ISOLATED = 3


class AlarmNumber(NamedTuple):
    """The name of a transition for ever: the life of the daemon that wrote it, and its number."""

    epoch: int
    number: int

    def __str__(self) -> str:
        return f"{self.epoch}.{self.number}"

    @classmethod
    def parse(cls, text: str) -> "AlarmNumber":
        """Reads ``EPOCH.NUMBER``."""
        epoch, dot, number = text.partition(".")
        if not (dot and epoch.isdecimal() and number.isdecimal() and text.isascii()):
            raise ValueError(f"`{text}` is no alarm number; write EPOCH.NUMBER")
        return cls(int(epoch), int(number))


@dataclass(frozen=True)
class Transition:
    """One change in the life of a fault, with the names of what it speaks of."""

    number: AlarmNumber
    written_ns: int
    instant_ns: int
    step: int
    state: AlarmState
    verdict_number: int
    flags: int
    occurrence: int
    #: The diagnoser; None if the daemon's present configuration has none like it.
    diagnoser: Optional[Diagnoser]
    #: Fault sets: bit j is fault j of the diagnoser.
    certainly_faulty: int
    possibly_faulty: int
    #: Index of the channel with the largest ratio; None if none was evaluated.
    channel: Optional[int]
    ratio: float
    fault_estimate: float
    fault_estimate_half_width: float

    @property
    def verdict(self) -> Verdict:
        """The verdict; a number that none has reads as NOT_EVALUATED."""
        return Verdict(self.verdict_number)

    @property
    def channel_name(self) -> Optional[str]:
        """Name of the channel, if it is known."""
        if self.diagnoser is None or self.channel is None or self.channel >= len(self.diagnoser.channels):
            return None
        return self.diagnoser.channels[self.channel].name

    def faults(self, fault_set: int) -> List[str]:
        """Names of the faults in one of its sets, as far as they are known."""
        return self.diagnoser.names_of(fault_set) if self.diagnoser else []


@dataclass(frozen=True)
class Gap:
    """The transitions ``first`` to ``last`` are lost. Each missing number lies in exactly one gap."""

    first: int
    last: int


@dataclass(frozen=True)
class NewNumbering:
    """The numbers have begun anew, with the life ``origin``; what was missed behind ``previous`` nobody knows."""

    previous: AlarmNumber
    origin: int


AlarmEvent = Union[Transition, Gap, NewNumbering]


class AlarmListener:
    """Hears every alarm transition of one instance once and in order, over all lives of its daemon.

    One thread at a time may use it. ``wait`` lets the other threads run.
    """

    def __init__(
        self,
        instance: str,
        runtime_directory: Optional[str] = None,
        *,
        start: Union[str, AlarmNumber] = "now",
        must_exist: bool = True,
    ) -> None:
        """Listens to ``instance``.

        :param start: ``"now"``: with the next transition; ``"oldest"``: with the oldest one that the daemon still
            keeps; a number: behind that transition.
        :param must_exist: if False the daemon need not have been started.
        :raises TableError: the table cannot be opened.
        """
        if not isinstance(start, AlarmNumber) and start not in ("now", "oldest"):
            raise ValueError(f"start is {start!r}; use 'now', 'oldest' or an AlarmNumber")
        self._start = start
        self._latest = LatestTable(table_path(instance, runtime_directory))
        self._position: Optional[AlarmNumber] = None
        self._pending: Optional[AlarmEvent] = None
        self._later: Optional[Table] = None
        try:
            self._later = self._latest.open()
        except TableError as error:
            if must_exist:
                raise
            if isinstance(error, NoTable) and start == "now":
                # Whatever comes is new.
                self._start = "oldest"
        self._enter_later()

    @property
    def position(self) -> Optional[AlarmNumber]:
        """The last transition that was handed out or reported missing; None: no table has been found yet."""
        if isinstance(self._pending, NewNumbering):
            return self._pending.previous
        if self._position is None and isinstance(self._start, AlarmNumber):
            return self._start
        return self._position

    @property
    def state(self) -> str:
        """``running``, ``hung``, ``closed`` or ``unreachable``, as far as this listener has looked."""
        return self._latest.state()

    def try_next(self) -> Optional[AlarmEvent]:
        """The next event if there is one; never waits."""
        while True:
            event, self._pending = self._pending, None
            if event is None:
                event = self._next_in_table()
            if event is not None:
                if isinstance(event, Transition):
                    self._position = event.number
                return event
            if not self._enter_later():
                # The daemon behind the latest table writes no more when there is a later one. What it wrote between
                # the look above and now is read before the later one is entered.
                self._later = self._latest.find_later()
                if self._later is None:
                    return None

    def wait(self, timeout: float, spin: float = 0.0) -> Optional[AlarmEvent]:
        """Waits for the next event, at most ``timeout`` seconds.

        :param spin: looks without pause for so many seconds before it sleeps.
        """
        begin = time.monotonic()
        while True:
            event = self.try_next()
            if event is not None:
                return event
            elapsed = time.monotonic() - begin
            if elapsed >= timeout:
                return None
            if elapsed >= spin:
                self._sleep(timeout - elapsed)

    def _sleep(self, timeout: float) -> None:
        table = self._latest.table
        if table is None or self._position is None:
            time.sleep(min(timeout, RETRY_PERIOD_S))
            return
        longest = _LONGEST_SLEEP_S if self._latest.is_running() else RETRY_PERIOD_S
        table.wait_for_alarm(self._position.number, min(timeout, longest))

    def _next_in_table(self) -> Optional[AlarmEvent]:
        table = self._latest.table
        if table is None or self._position is None:
            return None
        first = number = self._position.number + 1
        while (look := table.read_alarm(number)) == LOST:
            number = max(number + 1, _oldest_possible(table))
        behind = _named(look, table) if isinstance(look, AlarmWords) else None
        if number == first:
            return behind
        self._position = self._position._replace(number=number - 1)
        self._pending = behind
        return Gap(first, number - 1)

    def _enter_later(self) -> bool:
        """Goes over to the table of the later life, if there is one."""
        table, self._later = self._later, None
        if table is None:
            return False
        known, beginning = self.position, AlarmNumber(table.alarm_origin, 0)
        if known is not None and _continues(table, known):
            self._position = known
        elif known is not None:
            self._pending = NewNumbering(known, table.alarm_origin)
            self._position = beginning
        elif self._start == "now":
            newest = table.newest_alarm()
            # Overtaken in the moment it was read, the newest one was of this life.
            self._position = _seen(table, newest) or AlarmNumber(table.epoch, newest)
        else:
            oldest = _oldest_possible(table)
            while table.read_alarm(oldest) == LOST:
                oldest = max(oldest + 1, _oldest_possible(table))
            self._position = beginning._replace(number=oldest - 1)
        self._latest.set(table)
        return True


def _oldest_possible(table: Table) -> int:
    """Number of the oldest transition for which the ring has room."""
    return max(0, table.newest_alarm() - table.alarm_capacity) + 1


def _seen(table: Table, number: int) -> Optional[AlarmNumber]:
    look = table.read_alarm(number)
    return AlarmNumber(look.epoch, look.number) if isinstance(look, AlarmWords) else None


def _continues(table: Table, position: AlarmNumber) -> bool:
    """Whether the numbers of ``table`` go on from ``position``."""
    seen = _seen(table, position.number)
    return (
        table.alarm_origin <= position.epoch <= table.epoch
        and position.number <= table.newest_alarm()
        and (seen is None or seen.epoch == position.epoch)
    )


def _named(words: AlarmWords, table: Table) -> Transition:
    diagnosers = table.diagnosers
    return Transition(
        number=AlarmNumber(words.epoch, words.number),
        written_ns=words.written_ns,
        instant_ns=words.instant_ns,
        step=words.step,
        state=AlarmState(words.state),
        verdict_number=words.verdict,
        flags=words.flags,
        occurrence=words.occurrence,
        diagnoser=diagnosers[words.slot] if words.slot < len(diagnosers) else None,
        certainly_faulty=words.certainly_faulty,
        possibly_faulty=words.possibly_faulty,
        channel=None if words.channel == 0xFFFF_FFFF else words.channel,
        ratio=words.ratio,
        fault_estimate=words.fault_estimate,
        fault_estimate_half_width=words.fault_estimate_half_width,
    )

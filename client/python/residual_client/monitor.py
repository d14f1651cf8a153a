"""Polling the newest records."""

from __future__ import annotations

import time
from typing import List, Optional

from ._latest import LatestTable, table_path
from ._table import Table
from .records import Diagnoser, Freshness, Reading, Verdict

_OF_VERDICT = {Verdict.STARTING: Freshness.STARTING, Verdict.NOT_EVALUATED: Freshness.NOT_EVALUATED}


class NoSuchDiagnoser(LookupError):
    """The daemon has no diagnoser of this name (any more)."""


class Monitor:
    """A client's view of one instance, over all lives of its daemon.

    One thread at a time may use it.
    """

    def __init__(self, instance: str, runtime_directory: Optional[str] = None, *, must_exist: bool = True) -> None:
        """Opens the table of ``instance``.

        :param must_exist: if False the daemon need not have been started; until it is, every diagnoser is DEAD.
        :raises TableError: the table cannot be opened.
        """
        self._latest = LatestTable(table_path(instance, runtime_directory))
        if must_exist:
            self._latest.set(self._latest.open())

    @property
    def state(self) -> str:
        """``running``, ``hung``, ``closed`` or ``unreachable``."""
        self._refresh()
        return self._latest.state()

    @property
    def epoch(self) -> int:
        """Number of the daemon's latest known life; 0: none."""
        table = self._refresh()
        return table.epoch if table else 0

    @property
    def diagnosers(self) -> List[Diagnoser]:
        """The diagnosers of the daemon's latest known life."""
        table = self._refresh()
        return table.diagnosers if table else []

    def read(self, name: str) -> Reading:
        """The newest record of the diagnoser ``name`` and what it is worth now.

        :raises NoSuchDiagnoser: the daemon has none of this name.
        :raises Overtaken: the daemon writes faster than Python reads; try again.
        """
        table = self._refresh()
        if table is None:
            return Reading(Freshness.DEAD, 0.0, 0, 0, None)
        slot = table.slot_of(name)
        if slot is None:
            known = ", ".join(f"`{one.name}`" for one in table.diagnosers) or "none at all"
            raise NoSuchDiagnoser(f"the daemon has no diagnoser `{name}`; it has {known}")
        now_ns = time.monotonic_ns()
        number, record = table.read(slot)
        if not table.is_running(now_ns):
            return Reading(Freshness.DEAD, 0.0, number, table.epoch, record)
        if record is None:
            return Reading(Freshness.STARTING, 0.0, 0, table.epoch, None)
        spec = table.diagnosers[slot]
        age_ns = max(0, table.time_ns(now_ns) - record.instant_ns)
        if age_ns > table.stale_after_periods * spec.period_ns + spec.margin_ns:
            return Reading(Freshness.STALE, age_ns * 1e-9, number, table.epoch, record)
        freshness = _OF_VERDICT.get(record.verdict, Freshness.FRESH)
        return Reading(freshness, 0.0, number, table.epoch, record)

    def _refresh(self) -> Optional[Table]:
        later = self._latest.find_later()
        if later is not None:
            self._latest.set(later)
        return self._latest.table

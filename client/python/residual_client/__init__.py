"""Polls the records and alarms of a residuald daemon from shared memory, with the standard library only.

==================  ==========================
use                 what
==================  ==========================
poll the bounds     :class:`Monitor`
wait for alarms     :class:`AlarmListener`
==================  ==========================

Both read the daemon's bounds table through a read-only mapping and find the daemon again when it is started anew.
"""

from ._table import Damaged, NoTable, NotPermitted, OtherLayout, Overtaken, TableError
from .alarms import AlarmEvent, AlarmListener, AlarmNumber, AlarmState, Gap, NewNumbering, Transition
from .monitor import Monitor, NoSuchDiagnoser
from .records import Channel, ChannelName, Diagnoser, Freshness, Reading, StepRecord, Verdict

__all__ = [
    "AlarmEvent", "AlarmListener", "AlarmNumber", "AlarmState", "Channel", "ChannelName", "Damaged", "Diagnoser",
    "Freshness", "Gap", "Monitor", "NewNumbering", "NoSuchDiagnoser", "NoTable", "NotPermitted", "OtherLayout",
    "Overtaken", "Reading", "StepRecord", "TableError", "Transition", "Verdict",
]

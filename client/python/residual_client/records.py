"""What a diagnoser says at one sampling instant."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import List, Optional, Sequence, Tuple


class Verdict(IntEnum):
    """What a diagnoser concludes."""

    STARTING = 0
    NOMINAL = 1
    FAULT = 2
    ISOLATED = 3
    NOT_EVALUATED = 4
    GUARANTEE_LOST = 5

    @classmethod
    def _missing_(cls, value: object) -> "Verdict":
        return cls.NOT_EVALUATED


class Freshness(Enum):
    """How much a record is worth at the moment it is read; only FRESH says something about the plant now."""

    FRESH = "fresh"
    STALE = "stale"
    NOT_EVALUATED = "not evaluated"
    STARTING = "starting"
    DEAD = "dead"


@dataclass(frozen=True)
class Channel:
    """A residual between its bounds. The ratio is 1 at the bound; NaN: not evaluated at this instant."""

    lower: float
    residual: float
    upper: float
    ratio: float


@dataclass(frozen=True)
class StepRecord:
    """What a diagnoser says at one sampling instant. Bit j of a fault set is fault j of the diagnoser."""

    step: int
    instant_ns: int
    certainly_faulty: int
    possibly_faulty: int
    inputs_valid: int
    fault_estimate: float
    fault_estimate_half_width: float
    verdict_number: int
    flags: int
    skipped_instants: int
    channels: Sequence[Channel]

    @property
    def verdict(self) -> Verdict:
        """The verdict; a number that none has reads as NOT_EVALUATED."""
        return Verdict(self.verdict_number)

    def worst_channel(self) -> Optional[Tuple[int, Channel]]:
        """The evaluated channel with the largest ratio and its index."""
        evaluated = [(i, c) for i, c in enumerate(self.channels) if not math.isnan(c.ratio)]
        return max(evaluated, key=lambda one: one[1].ratio, default=None)


@dataclass(frozen=True)
class Reading:
    """A record and what it is worth."""

    freshness: Freshness
    #: Age of a stale record, seconds; otherwise 0.
    age_s: float
    #: Number of the record, from 1 in this life of the daemon. 0: there is none.
    number: int
    #: Number of the daemon's life; 0: there has not been one.
    epoch: int
    record: Optional[StepRecord]


@dataclass(frozen=True)
class ChannelName:
    """Name and unit of a channel."""

    name: str
    unit: str


@dataclass(frozen=True)
class Diagnoser:
    """A diagnoser of one life of the daemon."""

    name: str
    method: str
    period_ns: int
    phase_ns: int
    margin_ns: int
    channels: Sequence[ChannelName]
    faults: Sequence[str]

    def names_of(self, fault_set: int) -> List[str]:
        """Names of the faults in a set."""
        return [name for j, name in enumerate(self.faults) if fault_set >> j & 1]

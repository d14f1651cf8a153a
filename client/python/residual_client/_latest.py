"""The table of the latest known life of a daemon, and how a later one is found."""

from __future__ import annotations

import os
import time
from typing import Optional

from . import _layout as L
from ._table import Table, TableError

RETRY_PERIOD_S = 0.02


def table_path(instance: str, runtime_directory: Optional[str]) -> str:
    """Path of the bounds table of an instance."""
    if not instance or not all(c.isascii() and (c.islower() or c.isdigit() or c in "_-") for c in instance):
        raise ValueError(f"instance name `{instance}`: use only a-z, 0-9, `_` and `-`")
    if runtime_directory is None:
        runtime_directory = os.environ.get(L.RUNTIME_DIRECTORY_VARIABLE, L.DEFAULT_RUNTIME_DIRECTORY)
    return os.path.join(runtime_directory, f"residuald.{instance}.bounds")


class LatestTable:
    """The table of the latest known life of a daemon."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._retry_at = 0.0
        self.table: Optional[Table] = None
        self.error: Optional[TableError] = None

    def open(self) -> Table:
        """Opens the table that is there now."""
        return Table(self._path)

    def is_running(self) -> bool:
        """Whether the daemon of the known table lives."""
        return self.table is not None and self.table.is_running(time.monotonic_ns())

    def find_later(self) -> Optional[Table]:
        """The table of a later life, unless the known one lives or it was looked for just now."""
        now = time.monotonic()
        if self.is_running() or now < self._retry_at:
            return None
        self._retry_at = now + RETRY_PERIOD_S
        if self.table is not None and not self.table.is_replaced():
            return None
        try:
            return self.open()
        except TableError as error:
            self.error = error
            return None

    def set(self, table: Table) -> None:
        """Makes ``table`` the latest one."""
        self.table, self.error = table, None

    def state(self) -> str:
        """``running``, ``hung``, ``closed`` or ``unreachable``."""
        if self.is_running():
            return "running"
        if self.table is None or self.error is not None:
            return "unreachable"
        return "closed" if self.table.is_closed() else "hung"

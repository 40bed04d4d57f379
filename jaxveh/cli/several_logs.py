"""Several logs of one call: one that is refused, or whose filter fails, does not end the others."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from jaxveh import FilterError, InputError

LACKS = "the log has no "
"""What the reason of a log without a channel says."""


class SeveralLogs:
    """The `logs` of one call, and the errors of those that were `refused`; the error of a single log is raised at once."""

    def __init__(self, logs: Sequence[Path]):
        self.logs = tuple(logs)
        self.refused: dict[Path, InputError | FilterError] = {}

    @contextmanager
    def refuses(self, log: Path) -> Iterator[None]:
        """Keep an error about one of the logs, whose work ends with it."""
        try:
            yield
        except (InputError, FilterError) as error:
            if len(self.logs) == 1:
                raise
            self.refused[log] = error

    def each(self, work: Callable[[Any], Any], items: Mapping[Path, Any]) -> dict[Path, Any]:
        """Return the results of `work` on the items of the logs, without those that are refused."""
        done = {}
        for log, item in items.items():
            with self.refuses(log):
                done[log] = work(item)
        return done

    def reasons(self) -> dict[str, str]:
        """Return the reasons by the name of the log, each with the name of its log in it."""
        return {
            log.name: str(error) if log.name in str(error) else f"{log}: {error}" for log, error in self.refused.items()
        }

    def check_all(self) -> None:
        """Raise an error with all reasons if a log was refused: for a product that is made of all of them."""
        if self.refused:
            raise self._error(" ".join(self.reasons().values()))

    def check_some(self) -> None:
        """Raise an error with all reasons if every log was refused."""
        if len(self.refused) < len(self.logs):
            return
        reasons = self.reasons().values()
        parts = len(self.logs) > 1 and all(LACKS in one for one in reasons)
        remedy = " If they are the messages of one drive, give the folder that holds them, alone." if parts else ""
        raise self._error(" ".join(reasons) + remedy)

    def conclude(self) -> None:
        """Raise an error, which counts the logs and has all reasons, if some were refused: after the others are written."""
        if self.refused:
            count = f"{len(self.refused)} of {len(self.logs)} logs"
            raise self._error(f"no estimate of {count}; the others are written. {' '.join(self.reasons().values())}")

    def _error(self, words: str) -> Exception:
        """Return the error that the reasons make: one of input, which the user can correct, goes before one of a filter."""
        kinds = [type(error) for error in self.refused.values()]
        return next((kind for kind in kinds if issubclass(kind, InputError)), FilterError)(words)

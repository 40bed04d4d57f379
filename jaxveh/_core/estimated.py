"""Display and storage of all estimates along a log."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar, Self

import jax
import numpy as np

from jaxveh._core.errors import InputError
from jaxveh._core.labelled import TIME, Labelled, Variable, make_again, run_axes, time_again, time_axis
from jaxveh._core.names import as_mapping, check_names
from jaxveh._core.overview import Lazy, Overview, count_of, is_known, number, span, stretch
from jaxveh._core.packing import Packing, unpack
from jaxveh._core.result import Result
from jaxveh._core.shown import Kept, above

ENDINGS = {"mean": "", "std": "_std", "known": "_known"}
"""Endings of the variables of these fields after a quantity's name, as in the columns of `io.to_frame`."""


class Estimated(Kept):
    """An estimate with `time`, and `mean` and `std` by name.

    A class lists in `by_row` the fields with a value per instant, in `by_run` those with a value per run, and in `records` the
    classes of NamedTuples by name. Fields in neither list are not stored: they are None when the estimate is read back.
    """

    __slots__ = ()

    drawn_by = "estimate"
    by_row: ClassVar[tuple[str, ...]] = ("mean", "std")
    by_run: ClassVar[tuple[str, ...]] = ()
    records: ClassVar[dict[str, Any]] = {}

    def __getitem__(self, name: str) -> Any:
        """The mean of a quantity by name, (T,)."""
        self._need("mean")
        mean = as_mapping(getattr(self, "mean", None), "mean")
        check_names(f"{type(self).__name__}: mean", [name], mean)
        return mean[name]

    def to_pandas(self) -> Any:
        """Return a `pandas.DataFrame` with a column `time`, and for each quantity its mean `name` and `name_std`.

        A method that reports whether a quantity is known adds a column for that. Units are in `frame.attrs["units"]`. A batch
        also has a column `run`.
        """
        self._need("mean")
        return super().to_pandas()

    def plot(self, *arguments: Any, **options: Any) -> Any:
        """Draw a panel per quantity with its bands, and a truth if given; see `plots.estimate`. **Returns** the figure."""
        self._need("mean", "std")
        return super().plot(*arguments, **options)

    def _need(self, *names: str) -> None:
        lost = [name for name in names if getattr(self, name, None) is None]
        if lost:
            raise InputError(
                f"{type(self).__name__}: {', '.join(lost)} was not kept: run it with keep=('mean', 'std')."
            )

    def _labelled(self) -> Labelled:
        lead = self._lead()
        dims, time, facts = time_axis(getattr(self, TIME), lead)
        packing, plans = Packing(), {}
        for name in self.by_row:
            inside = "" if name in ENDINGS else None
            plans[name] = packing.add(getattr(self, name), name, dims, suffix=ENDINGS.get(name, ""), inside=inside)
        for name in self.by_run:
            plans[name] = packing.add(getattr(self, name), name, run_axes(lead))
        variables = {name: one._replace(unit=_unit(name)) for name, one in packing.variables.items()}
        shown = [f"{name}{ending}" for name in self._quantities() for ending in ENDINGS.values()]
        return Labelled(
            type(self).__name__,
            variables,
            {TIME: time, **packing.coordinates},
            tuple(name for name in shown if name in variables),
            "",
            {**facts, "plans": plans},
        )

    @classmethod
    def _of_labelled(cls, labelled: Labelled) -> Self:
        plans = labelled.facts["plans"]
        names = [field.name for field in dataclasses.fields(cls)]  # type: ignore[arg-type]
        fields = {name: unpack(plans.get(name), labelled.both, cls.records) for name in names}
        return make_again(cls, {**fields, TIME: time_again(labelled)})

    def _lead(self) -> int:
        """Return the number of dimensions of the batch: those of a value in addition to that of rows."""
        rows = [np.ndim(leaf) - 1 for name in self.by_row for leaf in jax.tree.leaves(getattr(self, name))]
        runs = [np.ndim(leaf) for name in self.by_run for leaf in jax.tree.leaves(getattr(self, name))]
        return min([*rows, *runs], default=np.ndim(getattr(self, TIME)) - 1)

    def _quantities(self) -> tuple[str, ...]:
        mean = getattr(self, "mean", None)
        return () if mean is None else tuple(as_mapping(mean))

    def _overview(self) -> Overview:
        names = self._quantities()
        mean, std, known = ({} if one is None else as_mapping(one) for one in self._said())
        title = (
            f"{type(self).__name__}: {count_of(len(names), 'quantity')}, {stretch(getattr(self, TIME))}{self._ended()}"
        )
        heads = ("quantity", "unit", "least", "most", "usual std", *(("known",) if known else ()))

        def row(name: str) -> tuple[str, ...]:
            cells = (name, _unit(name) or "-", *span(mean[name]), _usual(std.get(name)))
            return (*cells, _share(known[name])) if known else cells

        flat = lambda name: mean[name] if np.ndim(mean[name]) == 1 else None
        return Overview(title, heads, Lazy(names, row), 2, Lazy(names, flat))

    def _said(self) -> tuple[Any, Any, Any]:
        return getattr(self, "mean", None), getattr(self, "std", None), getattr(self, "known", None)

    def _ended(self) -> str:
        """Return the outcome in words."""
        result = getattr(self, "result", None)
        if result is None or not is_known(result):
            return ""
        codes = np.asarray(result).ravel()
        bad = codes[codes != 0]
        likelihood = getattr(self, "log_likelihood", None)
        told = "" if likelihood is None or np.ndim(likelihood) else f", log-likelihood {number(likelihood)}"
        return told + (f"; {Result(int(bad[0])).message} ({bad.size} of {codes.size})" if bad.size else "")


def _unit(name: str) -> str:
    return "" if name.endswith("_known") else above("io", "canonical_unit")(name) or ""


def _usual(std: Any) -> str:
    """Return the median of the finite values."""
    if std is None or not is_known(std):
        return "-"
    values = np.asarray(std, np.float64)
    values = values[np.isfinite(values)]
    return f"{np.median(values):.3g}" if values.size else "-"


def _share(known: Any) -> str:
    return f"{100 * np.mean(np.asarray(known)):.0f} %" if is_known(known) else "-"


def with_prefix(labelled: Labelled, prefix: str) -> dict[str, Variable]:
    """Return the variables of a result that is part of another, with a prefix."""
    return {f"{prefix}.{name}": one for name, one in labelled.variables.items()}

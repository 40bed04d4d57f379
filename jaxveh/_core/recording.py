"""A recording: named channels over one time base, with units and a note about its source."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.errors import InputError, check, check_one_of, check_single, is_concrete, word_for
from jaxveh._core.labelled import TIME, Labelled, Variable, make_again, time_again, time_axis
from jaxveh._core.names import as_mapping, as_names, check_names
from jaxveh._core.overview import Lazy, Overview, count_of, is_known, missing_share, number, span, stretch
from jaxveh._core.shown import Kept, above
from jaxveh._core.time_order import remedy

TRUTH = "true."


class Recording(Kept, eqx.Module):
    """Named channels over one time base.

    **Fields**: `time` (T,) in seconds, strictly increasing, steps may be irregular. `channels`: a mapping from name to
    (T,) array, NaN where a sensor has no sample. `units`: name to unit string. `source`: a note about its source.

    Channels of a simulation's truth are named `true.<name>`; `recording.truth` is a recording of those alone.
    Units and source are static: a jitted function that takes a whole recording is compiled again when they change, so
    `jaxveh.run` passes only the arrays to its compiled part.

    **Raises** `InputError` for an empty log, channels of another length, non-monotonic or non-finite time, and for what is not a
    real number: dates, differences of dates, complex numbers, text.
    """

    drawn_by = "recording"

    time: jax.Array | np.ndarray
    channels: dict[str, jax.Array]
    units: tuple[tuple[str, str], ...] = eqx.field(static=True)
    source: str = eqx.field(static=True)

    def __init__(self, time, channels: Mapping[str, object], units: Mapping[str, str] | None = None, source: str = ""):
        # Time stamps of a long log need float64 even if everything else runs in float32: they stay on the host.
        time = _numbers("time", time)
        if isinstance(time, np.ndarray):
            # It has been checked: `t = recording.time; t -= t[0]` would change the recording.
            time.flags.writeable = False
        self.time = time
        channels = as_mapping(channels, "recording: channels")
        units = {} if units is None else as_mapping(units, "recording: units")
        self.channels = {str(name): _float(str(name), values) for name, values in channels.items()}
        self.units = tuple(sorted(units.items()))
        if not isinstance(source, str):
            raise InputError(f"recording: source = {word_for(source)}: must be text, a note about where it comes from.")
        self.source = source

    def __check_init__(self):
        if self.time.ndim != 1 or self.time.shape[0] == 0:
            raise InputError(
                f"recording: time has shape {self.time.shape}; it must be (T,) with at least one row.{_several(self)}"
            )
        for name, values in self.channels.items():
            if values.shape != self.time.shape:
                raise InputError(f"recording: {name} has shape {values.shape}, time has {self.time.shape}; must agree.")
        if is_concrete(self.time):
            time = np.asarray(self.time)
            if not np.all(np.isfinite(time)):
                raise InputError(f"recording: time is not finite in row {int(np.argmin(np.isfinite(time)))}.")
            steps = np.diff(time)
            if np.any(steps <= 0):
                k = int(np.argmax(steps <= 0))
                raise InputError(
                    f"recording: time[{k + 1}] = {time[k + 1]} after time[{k}] = {time[k]}: must be strictly increasing. "
                    f"{remedy(time, k)}"
                )

    @classmethod
    def from_pandas(cls, frame: Any) -> Recording:
        """Make a recording from a data frame with a channel per column, such as one of `to_pandas`.

        See `io.from_frame` for time and units.
        """
        return above("io", "from_frame")(frame)

    def to_pandas(self) -> Any:
        """Return a `pandas.DataFrame`: `time` and a column per channel; units in `frame.attrs["units"]`. See `io.to_frame`."""
        return above("io", "to_frame")(self) if self.time.ndim == 1 else Kept.to_pandas(self)

    def __getitem__(self, name: str) -> jax.Array:
        check_names("recording", [name], self.channels)
        return self.channels[name]

    def __contains__(self, name: str) -> bool:
        return name in self.channels

    def __len__(self) -> int:
        return self.time.shape[0]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the channels."""
        return tuple(self.channels)

    def unit(self, name: str) -> str:
        """Return the unit of a channel, or `-` if none is given."""
        return dict(self.units).get(name, "-")

    @property
    def truth(self) -> Recording:
        """The simulated truth alone, under its plain names; raises `InputError` if there is none."""
        names = [name for name in self.channels if name.startswith(TRUTH)]
        if not names:
            raise InputError("recording.truth: this recording has no `true.` channels; only simulations have a truth.")
        units = dict(self.units)
        return Recording(
            self.time,
            {name.removeprefix(TRUTH): self.channels[name] for name in names},
            {name.removeprefix(TRUTH): units[name] for name in names if name in units},
            self.source,
        )

    def replace(self, source: str | None = None, units: Mapping[str, str] | None = None, **channels) -> Recording:
        """Return a copy with channels added or replaced by keyword ((T,) arrays), and `units` of new channels."""
        merged = {**dict(self.units), **({} if units is None else as_mapping(units, "recording.replace: units"))}
        return Recording(self.time, {**self.channels, **channels}, merged, self.source if source is None else source)

    def select(self, names) -> Recording:
        """Return a recording of these channels alone: a name, or several."""
        if names is None:
            raise InputError("recording.select: names = None: must be the name of a channel, or several.")
        names = as_names(names, "recording.select: names")
        check_names("recording.select", names, self.channels)
        units = {name: unit for name, unit in self.units if name in names}
        return Recording(self.time, {name: self.channels[name] for name in names}, units, self.source)

    def without(self, *names: str) -> Recording:
        """Return a recording without these channels, so that nothing downstream can use them."""
        check_names("recording.without", names, self.channels)
        return self.select([name for name in self.channels if name not in names])

    def between(self, start: float, end: float) -> Recording:
        """Return the rows with start <= time < end, in the log's own time; raise `InputError` if there are none."""
        check_single(**{"recording.between: start": start, "recording.between: end": end})
        time = np.asarray(self.time)
        rows = np.flatnonzero((time >= start) & (time < end))
        if rows.size == 0:
            raise InputError(f"span {start}:{end}: contains no row; the log runs from {time[0]} to {time[-1]} s.")
        return self.rows(slice(int(rows[0]), int(rows[-1]) + 1))

    def rows(self, which: slice) -> Recording:
        """Return the rows of a slice, or of a mask or whole numbers (an array). **Raises** `InputError` for anything else."""
        try:
            channels = {name: values[which] for name, values in self.channels.items()}
        except (TypeError, IndexError):
            raise InputError(
                f"recording.rows: which = {word_for(which)}: must be a slice such as slice(0, 100), a mask (T,) or an array of "
                f"whole numbers; there are {len(self)} rows."
            ) from None
        return Recording(self.time[which], channels, dict(self.units), self.source)

    def fill(self, channel: str, method: str = "hold", max_gap: float = np.inf) -> Recording:
        """Fill NaNs of one channel by `hold` (last value) or `linear`, over gaps of at most `max_gap` seconds.

        A gap is the time between the finite samples on its two sides. Longer gaps stay NaN, and so do rows before the first
        finite sample, and for `linear` those after the last. Runs on the host, outside jit.
        """
        check_one_of("method", method, ("hold", "linear"))
        check_single(**{"recording.fill: max_gap": max_gap})
        check("recording.fill: max_gap", max_gap, lambda v: v > 0, "positive (s), or infinite for any gap")
        check_recording("recording.fill", self)
        values, time = np.array(self[channel]), np.asarray(self.time)
        known = np.flatnonzero(np.isfinite(values))
        missing = np.flatnonzero(np.isnan(values))
        if known.size == 0:
            raise InputError(f"fill: {channel} has no finite sample at all; leave the channel out.")
        after = np.searchsorted(known, missing)
        inside = (after > 0) & ((after < known.size) | (method == "hold"))
        missing, after = missing[inside], after[inside]
        before = known[after - 1]
        following = known[np.minimum(after, known.size - 1)]
        reach = np.where(after < known.size, time[following], time[missing])
        short = reach - time[before] <= max_gap
        missing, before, following = missing[short], before[short], following[short]
        if method == "hold":
            values[missing] = values[before]
        else:
            share = (time[missing] - time[before]) / (time[following] - time[before])
            values[missing] = values[before] + share * (values[following] - values[before])
        return self.replace(**{channel: values})

    def _labelled(self) -> Labelled:
        lead = max((values.ndim for values in self.channels.values()), default=1) - 1
        dims, time, facts = time_axis(self.time, lead)
        units = dict(self.units)
        variables = {name: Variable(dims, values, units.get(name, "")) for name, values in self.channels.items()}
        if TIME in variables:
            raise InputError("a channel is named `time`, which is the name of the time column; rename it.")
        return Labelled("Recording", variables, {TIME: time}, tuple(variables), self.source, {**facts, "units": units})

    @classmethod
    def _of_labelled(cls, labelled: Labelled) -> Recording:
        if not labelled.kind:
            return _of_strangers(labelled)
        channels = {name: jnp.asarray(one.values) for name, one in labelled.variables.items()}
        units, source = tuple(sorted(labelled.facts["units"].items())), labelled.source
        time = time_again(labelled)
        if time.ndim > 1:
            return make_again(cls, {"time": time, "channels": channels, "units": units, "source": source})
        return cls(time, channels, dict(units), source)

    def _overview(self) -> Overview:
        names, shape = list(self.channels), self.time.shape
        title = f"Recording: {count_of(len(names), 'channel')}, {stretch(self.time)}"
        title += f", {self.source!r}" if self.source else ""
        if not is_known(self.time) or len(shape) > 1:
            rows = [(name, self.unit(name), number(self.channels[name])) for name in names]
            return Overview(title, ("channel", "unit", "values"), rows, 2)
        rows = Lazy(names, lambda name: (name, self.unit(name), *span(self[name]), missing_share(self[name])))
        return Overview(
            title, ("channel", "unit", "least", "most", "missing"), rows, 2, Lazy(names, self.channels.__getitem__)
        )


def time_for(recording: Recording, dtype: Any) -> jax.Array | np.ndarray:
    """The time of a recording (T,), s; from its first row where `dtype` would not resolve the steps of stamps since 1970."""
    time = recording.time
    return time - time[0] if isinstance(time, np.ndarray) and dtype != np.float64 else time


def _of_strangers(labelled: Labelled) -> Recording:
    """Make a recording of every variable whose only dimension is `time`."""
    time = labelled.both.get(TIME)
    if time is None or time.dims != (TIME,):
        raise InputError(
            f"no coordinate `time` over a dimension `time`; there are: {', '.join(labelled.both) or 'none'}."
        )
    found = {name: one for name, one in labelled.both.items() if one.dims == (TIME,) and name != TIME}
    channels = {
        name: jnp.asarray(one.values) for name, one in found.items() if np.asarray(one.values).dtype.kind in "fiub"
    }
    units = {name: found[name].unit for name in channels if found[name].unit}
    return Recording(np.asarray(time.values), channels, units, labelled.source)


def _float(name: str, values) -> jax.Array:
    if isinstance(values, jax.Array) and jnp.issubdtype(values.dtype, jnp.floating):
        return values
    return jnp.asarray(_numbers(name, values), dtype=float)


NO_NUMBERS = {
    "M": 'dates: give seconds, e.g. ({0} - {0}[0]) / np.timedelta64(1, "s")',
    "m": 'differences of dates: give seconds, e.g. {0} / np.timedelta64(1, "s")',
    "c": "complex numbers: give np.real({0}), np.imag({0}) or np.abs({0})",
    "U": "text: convert it, e.g. {0}.astype(float)",
    "S": "text: convert it, e.g. {0}.astype(float)",
    "V": "no numbers: convert them, or leave them out",
}
"""What values are that are no real numbers, and the remedy, by the kind of their NumPy type; {0}: their name."""


def _numbers(name: str, values):
    """The values as an array of real numbers, those of JAX as they are. **Raises** `InputError` for others, which NumPy would
    convert without a word: dates to counts of their own unit, text to the number that it spells."""
    if isinstance(values, jax.Array):
        kind = "V" if jnp.issubdtype(values.dtype, jax.dtypes.extended) else np.dtype(values.dtype).kind
    else:
        values, kind = _on_the_host(values)
    if kind in NO_NUMBERS:
        raise InputError(f"recording: {name} must be real numbers; it holds {NO_NUMBERS[kind].format(name)}.")
    return values


def _on_the_host(values) -> tuple[Any, str]:
    """The values as an array, and the kind of its type, of Python's objects that of what they are; None and what NumPy masks
    become NaN.

    The array is a copy: the caller may write into the original later, and jax would share the memory of some arrays.
    """
    if isinstance(values, np.ma.MaskedArray):
        hidden = np.ma.getmaskarray(values)
        values, kind = _on_the_host(values.data)
        return (values if kind in NO_NUMBERS else np.where(hidden, np.nan, values)), kind
    try:
        values = np.asarray(values)
        kinds = {_kind_of(one) for one in values.flat} if values.dtype.kind == "O" else {values.dtype.kind}
        wrong = [kind for kind in NO_NUMBERS if kind in kinds]
        return (values, wrong[0]) if wrong else (np.array(values, np.float64), "f")
    except (TypeError, ValueError):
        return values, "V"


def _kind_of(one) -> str:
    if isinstance(one, datetime.date | datetime.timedelta):
        return "M" if isinstance(one, datetime.date) else "m"
    return np.asarray(one).dtype.kind


def check_recording(who: str, recording: Any) -> None:
    """Raise `InputError` unless it is a `Recording` of one drive; those that `jax.vmap` returns hold several."""
    if not isinstance(recording, Recording):
        raise InputError(
            f"{who}: recording = {word_for(recording)}: must be a Recording: jaxveh.Recording(time, {{name: values}}), or "
            "the result of io.read_recording or simulate."
        )
    if np.ndim(recording.time) != 1:
        raise InputError(
            f"{who}: recording.time has shape {np.shape(recording.time)}: must be (T,), one drive.{_several(recording)}"
        )


def _several(recording: Recording) -> str:
    """What to do with several drives in one, as `jax.vmap` returns them; "" for one."""
    one = " Take one of several, jax.tree.map(lambda leaf: leaf[0], recordings), or use jax.vmap over them."
    return one if np.ndim(recording.time) > 1 else ""


def gap_to_fill(recording: Recording, name: str) -> float:
    """Return the length (s) up to which gaps of a channel must be filled so that none is left, rounded up to milliseconds.

    A gap is the time between two samples with rows in between, or beyond the first or last one. It is infinite without any
    sample.
    """
    time, known = np.asarray(recording.time), np.flatnonzero(np.isfinite(np.asarray(recording[name])))
    if known.size == 0:
        return float("inf")
    inside = np.diff(time[known])[np.diff(known) > 1]
    longest = max(inside.max(initial=0.0), time[known[0]] - time[0], time[-1] - time[known[-1]])
    return float(np.ceil(1e3 * longest + 1e-3) / 1e3)

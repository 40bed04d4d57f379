"""Recordings: shapes, times, truth, selections, spans, filling on request, and errors that name the thing."""

import datetime
import decimal
import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Recording

NAN = np.nan


def make(**channels):
    channels = channels or {"a": [1.0, 2.0, 3.0, 4.0], "true.a": [1, 2, 3, 5]}
    return Recording([0.0, 0.5, 1.5, 2.0], channels, {"a": "m/s", "true.a": "m/s"}, "here")


def test_channels_units_and_source():
    recording = make()
    assert recording.names == ("a", "true.a")
    assert len(recording) == 4
    assert "a" in recording
    assert "b" not in recording
    assert recording.unit("a") == "m/s"
    assert make(c=[1, 2, 3, 4]).unit("c") == "-"
    assert recording["true.a"].dtype == jnp.float64
    assert recording.time.dtype == np.float64
    assert recording.source == "here"


def test_truth_select_without_replace():
    recording = make()
    np.testing.assert_array_equal(recording.truth["a"], [1, 2, 3, 5])
    assert recording.truth.unit("a") == "m/s"
    assert recording.select(["a"]).names == ("a",)
    assert recording.without("a").names == ("true.a",)
    longer = recording.replace(b=np.zeros(4), units={"b": "rad"})
    assert longer.names == ("a", "true.a", "b")
    assert (longer.unit("a"), longer.unit("b")) == ("m/s", "rad")
    assert recording.replace(source="there").source == "there"
    np.testing.assert_array_equal(recording.replace(a=np.zeros(4))["a"], 0.0)


def test_spans_are_half_open_and_in_the_log_s_own_time():
    recording = make()
    np.testing.assert_array_equal(recording.between(0.5, 2.0).time, [0.5, 1.5])
    np.testing.assert_array_equal(recording.rows(slice(1, None, 2))["a"], [2.0, 4.0])
    with pytest.raises(InputError, match=r"span 5:6: contains no row; the log runs from 0\.0 to 2\.0 s"):
        recording.between(5, 6)


@pytest.mark.parametrize(
    ("method", "max_gap", "values", "filled"),
    [
        ("hold", np.inf, [NAN, 1, NAN, NAN], [NAN, 1, 1, 1]),
        ("linear", np.inf, [1, NAN, 4, NAN], [1, 2, 4, NAN]),
        ("hold", 1.0, [1, NAN, 4, NAN], [1, NAN, 4, 4]),
        ("linear", 1.5, [1, NAN, 4, NAN], [1, 2, 4, NAN]),
        ("linear", 1.4, [1, NAN, 4, NAN], [1, NAN, 4, NAN]),
        ("hold", 0.4, [1, 2, 3, NAN], [1, 2, 3, NAN]),
    ],
)
def test_fill(method, max_gap, values, filled):
    before = make(a=values)
    np.testing.assert_allclose(before.fill("a", method, max_gap)["a"], filled)
    np.testing.assert_array_equal(before["a"], values)


@pytest.mark.parametrize(
    ("make_it", "message"),
    [
        (lambda: Recording([], {}), r"time has shape \(0,\)"),
        (lambda: Recording([[0.0, 1.0]], {}), r"time has shape \(1, 2\)"),
        (lambda: Recording([0.0, 1.0], {"a": [1.0]}), r"a has shape \(1,\), time has \(2,\)"),
        (lambda: Recording([0.0, NAN], {}), "time is not finite in row 1"),
        (
            lambda: Recording([0.0, 2.0, 1.0], {}),
            r"time\[2\] = 1\.0 after time\[1\] = 2\.0: must be strictly increasing.* Split them where time steps back",
        ),
        (
            lambda: Recording([0.0, 1.0, 1.0], {}),
            r"Two rows have this time: an event .* otherwise sort the rows and drop repeated time stamps",
        ),
        (lambda: make()["b"], r"unknown name\(s\) b; there are: a, true\.a"),
        (lambda: make().select(["x"]), r"select: unknown name\(s\) x"),
        (lambda: make().without("x"), r"without: unknown name\(s\) x"),
        (lambda: make(a=[1, 2, 3, 4]).truth, "no `true.` channels"),
        (lambda: make(a=[NAN] * 4).fill("a"), "a has no finite sample at all"),
        (lambda: make().fill("a", "cubic"), r"method = 'cubic': must be one of 'hold', 'linear'"),
    ],
)
def test_errors_name_the_thing(make_it, message):
    with pytest.raises(InputError, match=message):
        make_it()


DATES = np.datetime64("2024-01-01", "ns") + np.arange(3) * np.timedelta64(100, "ms")
NO_NUMBERS = {
    "dates": (DATES, r"it holds dates: give seconds, e\.g\. \({0} - {0}\[0\]\) / np\.timedelta64\(1, \"s\"\)"),
    "whole dates": (DATES.astype("datetime64[D]"), "it holds dates: give seconds"),
    "Python's dates": ([datetime.datetime(2024, 1, 1, second=k) for k in range(3)], "it holds dates: give seconds"),
    "differences": (DATES - DATES[0], r"it holds differences of dates: give seconds, e\.g\. {0} / np\.timedelta64"),
    "Python's differences": ([datetime.timedelta(seconds=k) for k in range(3)], "it holds differences of dates"),
    "complex": (np.arange(3) + 0j, r"it holds complex numbers: give np\.real\({0}\)"),
    "complex, of JAX": (jnp.asarray(np.arange(3) + 0j), r"it holds complex numbers: give np\.real\({0}\)"),
    "text": (["0", "1", "2"], r"it holds text: convert it, e\.g\. {0}\.astype\(float\)"),
    "text among numbers": (np.array([0.0, "1", 2.0], object), "it holds text"),
    "bytes": ([b"0", b"1", b"2"], "it holds text"),
    "lists": ([[0.0], [1.0, 2.0], [3.0]], "it holds no numbers"),
    "a mapping": ({"a": 1.0}, "it holds no numbers"),
    "keys": (jax.random.split(jax.random.key(0), 3), "it holds no numbers"),
}


@pytest.mark.parametrize("kind", NO_NUMBERS)
def test_what_is_no_real_number_is_refused_by_name(kind):
    """NumPy would take dates as counts of their own unit, and a complex number's real part."""
    values, message = NO_NUMBERS[kind]
    with warnings.catch_warnings(action="error"):
        with pytest.raises(InputError, match=r"recording: time must be real numbers; " + message.format("time")):
            Recording(values, {"a": np.arange(3.0)})
        with pytest.raises(InputError, match=r"recording: a must be real numbers; " + message.format("a")):
            Recording(np.arange(3.0), {"a": values})
        with pytest.raises(InputError, match=r"recording: b must be real numbers"):
            Recording(np.arange(3.0), {}).replace(b=values)


def test_every_kind_of_real_number_is_taken():
    for values in (np.arange(3), [0, 1, 2], np.arange(3, dtype=np.uint8), np.arange(3, dtype=np.float16),
                   [decimal.Decimal(k) for k in range(3)], (DATES - DATES[0]) / np.timedelta64(100, "ms")):  # fmt: skip
        recording = Recording(values, {"a": values, "b": [None, True, 2]})
        assert recording.time.dtype == np.float64 and recording["a"].dtype == jnp.float64
        np.testing.assert_array_equal(recording.time, np.arange(3.0))
        np.testing.assert_array_equal(recording["a"], np.arange(3.0))
        np.testing.assert_array_equal(recording["b"], [NAN, 1.0, 2.0])


def test_what_numpy_masks_is_missing():
    """Readers of files mask samples that are invalid; below the mask is whatever number."""
    hidden = [False, True, False]
    for kind in (float, np.float32, int, bool):
        recording = Recording(np.arange(3.0), {"a": np.ma.masked_array(np.arange(3).astype(kind), hidden)})
        np.testing.assert_array_equal(recording["a"], [0.0, NAN, 1.0 if kind is bool else 2.0])
    assert not np.isnan(Recording(np.arange(3.0), {"a": np.ma.masked_array(np.arange(3))})["a"]).any()
    with pytest.raises(InputError, match="time is not finite in row 1"):
        Recording(np.ma.masked_array(np.arange(3.0), hidden), {})
    with pytest.raises(InputError, match="a must be real numbers; it holds text"):
        Recording(np.arange(3.0), {"a": np.ma.masked_array(["0", "1", "2"], hidden)})


def test_later_changes_of_arrays_do_not_reach_a_recording():
    """Of an array at a multiple of 64 bytes jax shares the memory, of others not."""
    room = np.zeros(8 * 12, np.uint8)
    for start in range(-room.ctypes.data % 8, 65, 8):
        mine = room[start : start + 24].view(float)
        mine[...] = [0.0, 1.0, 2.0]
        recording = Recording(mine, {"a": mine})
        mine += 5.0
        np.testing.assert_array_equal(recording["a"], [0.0, 1.0, 2.0])
        np.testing.assert_array_equal(recording.time, [0.0, 1.0, 2.0])
    with pytest.raises(ValueError, match="read-only"):
        recording.time[0] = 3.0


def test_a_recording_passes_through_jit_and_vmap():
    recording = make(a=np.arange(4.0))
    doubled = jax.jit(lambda r: r.replace(a=2 * r["a"]))(recording)
    np.testing.assert_array_equal(doubled["a"], 2 * np.arange(4.0))
    many = jax.vmap(lambda a: recording.replace(a=a))(jnp.ones((3, 4)))
    assert many.channels["a"].shape == (3, 4)


def test_times_keep_their_digits_without_x64(float32):
    recording = Recording(1.7e9 + np.array([0.0, 0.01]), {"a": [1.0, 2.0]})
    np.testing.assert_allclose(np.diff(recording.time), 0.01, rtol=1e-4)
    assert recording["a"].dtype == jnp.float32


@pytest.mark.parametrize("since", [0.0, 86_400.0, 1.7e9])
def test_stamps_that_float32_has_worn_down_are_told_from_repeated_ones(since):
    time = (since + 0.001 * np.arange(500)).astype(np.float32)
    if np.all(np.diff(time) > 0):
        assert Recording(time, {"a": time}).time.dtype == np.float64
        time = np.sort(np.append(time, time[7]))
        pattern = "drop repeated time stamps"
    else:
        pattern = "lost their digits in float32" if since > 1e5 else "drop repeated time stamps"
    with pytest.raises(InputError, match=pattern):
        Recording(time, {"a": time})
    # Whole seconds since 1970, twice, are as they were written.
    with pytest.raises(InputError, match="drop repeated"):
        Recording(np.array([1_700_000_001.0, 1_700_000_001.0]), {"a": np.zeros(2)})

"""Lengths that logs of similar length share."""

import warnings

import jax
import numpy as np

from jaxveh._core.lengths import LEAST, common_length, lengthen, lengthen_time, shorten


def test_a_common_length_holds_the_rows_and_at_most_a_quarter_more():
    for rows in [*range(1, 3000), 20_000, 27_501, 131_072, 131_073, 720_001]:
        length = common_length(rows)
        assert rows <= length <= max(LEAST, 1.25 * rows), rows
        assert common_length(length) == length


def test_four_lengths_serve_logs_up_to_twice_as_long():
    for shortest in (200, 6001, 27_500):
        assert len({common_length(rows) for rows in range(shortest, 2 * shortest)}) <= 5


def test_rows_are_added_at_the_end_and_taken_off_again_without_compiling():
    compiled = []
    count = lambda event, duration, **more: compiled.append(event) if event.endswith("compile_duration") else None
    rng = np.random.default_rng(0)
    tree = {"a": rng.normal(size=37), "b": rng.normal(size=(37, 2)).astype(np.float32), "c": np.arange(37) > 20}
    time = np.linspace(1.7e6, 1.7e6 + 3.6, 37)
    jax.monitoring.register_event_duration_secs_listener(count)
    longer, times, alone = lengthen(tree, 48), lengthen_time(time, 48), lengthen_time(time[:1], 4)
    again = shorten(longer, 37)
    assert not compiled
    for name, values in tree.items():
        np.testing.assert_array_equal(again[name], values)
        assert again[name].dtype == values.dtype and longer[name].shape == (48, *values.shape[1:])
        np.testing.assert_array_equal(longer[name][37:], np.broadcast_to(values[-1], longer[name][37:].shape))
    np.testing.assert_array_equal(times[:37], time)
    assert (np.diff(times) > 0).all() and abs(float(times[-1]) - time[-1] - 1.1) < 1e-6
    np.testing.assert_array_equal(alone, time[0] + np.arange(4.0))


def test_rows_stay_on_their_device_and_times_may_be_too_large():
    devices = jax.devices()
    there = jax.device_put(np.arange(50.0), devices[-1])
    assert shorten({"x": there}, 30)["x"].devices() == {devices[-1]}
    assert shorten(np.arange(5.0), 3).shape == (3,)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        times = lengthen_time(np.asarray([0.0, 2e38], np.float32), 8)
    assert times.shape == (8,) and np.isinf(times[-1])

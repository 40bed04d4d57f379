"""The errors of a channel: gain and offset exactly, noise and drift by their statistics, limits and steps."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError
from jaxveh.sensors import Signal
from jaxveh.sensors.randomness import gauss_markov, on_and_off, walk
from jaxveh.sensors.spans import as_spans, check_spans, inside
from jaxveh.statespace import cast

PERIOD = 0.01
RAMP = jnp.asarray(np.linspace(-2.0, 2.0, 401))


def test_without_errors_it_says_the_truth():
    np.testing.assert_array_equal(Signal().apply(RAMP, PERIOD, jax.random.key(0)), RAMP)


def test_gain_and_offset_are_exact():
    np.testing.assert_allclose(Signal(bias=0.3, scale=-0.1).apply(RAMP, PERIOD), 0.9 * RAMP + 0.3, rtol=1e-12)


def test_noise_has_its_spread_and_is_white():
    noise = np.asarray(Signal(noise=0.2).apply(jnp.asarray(np.zeros(20000)), PERIOD, jax.random.key(1)))
    # Three standard errors of each statistic.
    assert abs(noise.mean()) < 3 * 0.2 / np.sqrt(20000)
    np.testing.assert_allclose(noise.std(), 0.2, rtol=3 / np.sqrt(2 * 20000))
    assert abs(np.mean(noise[1:] * noise[:-1])) / 0.04 < 3 / np.sqrt(20000)


def test_without_a_key_nothing_is_random():
    signal = Signal(noise=0.2, drift=1.0, bias=0.1)
    np.testing.assert_array_equal(signal.apply(0 * RAMP, PERIOD), 0.1)


def spread(process):
    """Variances over 4000 runs at each instant."""
    return np.var(runs(process), axis=0)


def runs(process):
    """4000 of them, drawn by one program."""
    return np.asarray(jax.jit(lambda key: jax.vmap(process)(jax.random.split(key, 4000)))(jax.random.key(2)))


def test_the_walks_variance_grows_with_time():
    found = spread(lambda key: walk(key, 401, jnp.asarray(0.3), PERIOD, jnp.float64))
    t = PERIOD * np.arange(401)
    assert found[0] == 0
    np.testing.assert_allclose(found[1:], 0.09 * t[1:], rtol=4 * np.sqrt(2 / 4000))


def test_the_gauss_markov_process_has_its_variance_and_memory():
    time = 0.5
    draw = lambda key: gauss_markov(key, 401, jnp.asarray(0.3), jnp.asarray(time), PERIOD, jnp.float64)
    drawn = runs(draw)
    t = PERIOD * np.arange(401)
    expected = 0.09 * time / 2 * -np.expm1(-2 * t / time)
    assert (drawn[:, 0] == 0).all()
    np.testing.assert_allclose(drawn.var(axis=0)[1:], expected[1:], rtol=4 * np.sqrt(2 / 4000))
    correlation = np.corrcoef(drawn[:, 350], drawn[:, 400])[0, 1]
    np.testing.assert_allclose(correlation, np.exp(-0.5 / time), atol=4 / np.sqrt(4000))


def test_a_signal_drifts_as_its_processes_do():
    zeros, key = 0 * RAMP, jax.random.key(5)
    walked = spread(lambda key: Signal(drift=0.3).apply(zeros, PERIOD, key))
    np.testing.assert_allclose(walked[-1], 0.09 * 4.0, rtol=4 * np.sqrt(2 / 4000))
    forgot = spread(lambda key: Signal(drift=0.3, drift_time=0.5).apply(zeros, PERIOD, key))
    np.testing.assert_allclose(forgot[-1], 0.09 * 0.25, rtol=4 * np.sqrt(2 / 4000))
    several = Signal(drift=0.3, noise=0.1), Signal(noise=0.1), Signal(drift=0.3)
    both, noise, drift = jax.jit(lambda key: [signal.apply(zeros, PERIOD, key) for signal in several])(key)
    alone = np.asarray(noise) + np.asarray(drift)
    np.testing.assert_allclose(both, alone, rtol=1e-12)


def test_saturation_cuts_both_sides_after_the_offset():
    said = Signal(bias=0.5, saturation=1.0).apply(RAMP, PERIOD)
    np.testing.assert_allclose(said, np.clip(np.asarray(RAMP) + 0.5, -1, 1), rtol=1e-12)
    assert said.min() == -1 and said.max() == 1


def test_quantisation_rounds_to_steps_last():
    said = np.asarray(Signal(bias=0.03, quantisation=0.25).apply(RAMP, PERIOD))
    np.testing.assert_allclose(said / 0.25, np.round(said / 0.25), atol=1e-12)
    assert np.max(np.abs(said - (np.asarray(RAMP) + 0.03))) <= 0.125 + 1e-12
    assert len(np.unique(said)) == 17


@pytest.mark.parametrize(("dtype", "slack"), [(jnp.float32, 1e-6), (jnp.float64, 1e-15)])
@pytest.mark.parametrize(("saturation", "step", "most"), [(1.0, 0.6, 0.6), (1.7, 0.2, 1.6), (0.3, 0.1, 0.3)])
def test_a_rounded_channel_says_at_most_the_largest_step_within_its_limit(saturation, step, most, dtype, slack):
    signal = cast(Signal(saturation=saturation, quantisation=step), dtype)
    said = np.asarray(signal.apply(RAMP.astype(dtype), PERIOD), np.float64)
    np.testing.assert_allclose((said.min(), said.max()), (-most, most), rtol=slack)
    assert abs(said).max() <= saturation * (1 + slack)


def test_random_outages_begin_and_last_as_they_should():
    rate, length = 0.5, 0.4
    out = np.asarray(on_and_off(jax.random.key(4), 400_000, jnp.asarray(rate), jnp.asarray(length), PERIOD))
    share = rate / (rate + 1 / length)
    begins = np.flatnonzero(out[1:] & ~out[:-1])
    ends = np.flatnonzero(~out[1:] & out[:-1])
    assert not out[0]
    # About 670 outages in 4000 s, whose lengths are exponential: their mean is known to 4 %, and so is the share.
    np.testing.assert_allclose(out.mean(), share, rtol=0.12)
    lengths = (ends[: len(begins)] - begins[: len(ends)]) * PERIOD
    np.testing.assert_allclose(lengths.mean(), length, rtol=0.12)
    np.testing.assert_allclose(len(begins) / (PERIOD * np.sum(~out)), rate, rtol=0.12)


def test_spans_hold_their_start_and_not_their_end():
    times = jnp.asarray(np.arange(11) / 10)
    spans = as_spans([(0.2, 0.4), (0.9, np.inf)])
    np.testing.assert_array_equal(np.flatnonzero(inside(times, spans)), [2, 3, 9, 10])
    np.testing.assert_array_equal(inside(times.astype(jnp.float32), spans), inside(times, spans))
    assert as_spans((1, 2)) == ((1.0, 2.0),) and as_spans(()) == ()


@pytest.mark.parametrize("bad", [(2.0, 1.0), (1.0, 1.0), (np.nan, 1.0), (-np.inf, 1.0), (1.0, 2.0, 3.0)])
def test_bad_spans_are_refused(bad):
    with pytest.raises(InputError, match=r"outages = \(.*\): must be pairs \(start, end\)"):
        check_spans("outages", as_spans([bad]))


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"noise": 0.0}, r"Signal\.noise = 0\.0: must be positive"),
        ({"noise": -0.1}, r"Signal\.noise = -0\.1: must be positive"),
        ({"bias": np.nan}, r"Signal\.bias = nan: must be finite"),
        ({"scale": np.inf}, r"Signal\.scale = inf: must be finite"),
        ({"drift": -1.0}, r"Signal\.drift = -1\.0: must be positive"),
        ({"drift": 1.0, "drift_time": 0.0}, r"Signal\.drift_time = 0\.0: must be positive"),
        ({"drift_time": 5.0}, r"Signal\.drift_time = 5\.0: needs drift"),
        ({"saturation": 0.0}, r"Signal\.saturation = 0\.0: must be positive"),
        ({"quantisation": -0.1}, r"Signal\.quantisation = -0\.1: must be positive"),
    ],
)
def test_bad_numbers_are_named(numbers, message):
    with pytest.raises(InputError, match=message):
        Signal(**numbers)

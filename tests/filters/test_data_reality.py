"""What data are like: late, out of order, with noise that varies and inputs that are noisy themselves."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn_systems import drawn, linear
from filter_systems import kalman, linear_model, linear_recording

from jaxveh import FilterError, InputError, Recording, Result, filters
from jaxveh import statespace as ss
from jaxveh._core.names import record_type
from jaxveh.statespace.process import Together

MODEL = linear()
RECORDING = linear_recording(MODEL, rows=30)
ROWS = jax.tree.map(np.asarray, MODEL.rows(RECORDING))
DRAWN = jax.tree.map(np.asarray, MODEL.rows(drawn()))


def taken(rows, order):
    return jax.tree.map(lambda leaf: leaf[np.asarray(order)], rows)


def kalman_in_order(rows):
    """The Kalman filter's answer. Rows without measurements at the last row's time, which change nothing, make all of one length:
    one program for all."""
    more = 48 - len(rows.t)
    held, none = (lambda leaf: np.append(leaf, np.repeat(leaf[-1], more))), np.full(more, np.nan)
    longer = lambda rows: rows._replace(
        t=held(rows.t), u=jax.tree.map(held, rows.u), y=jax.tree.map(lambda leaf: np.append(leaf, none), rows.y)
    )
    return filters.scan(filters.Kalman(), MODEL, longer(rows))


OUT_OF_ORDER = filters.Delayed(filters.Kalman(), depth=6)


def in_its_own_place(log, delay):
    """The log whose `y1` is `delay` late, with every value at the time at which it was measured.

    A late value that is missing makes no row: the model's steps of Euler must be the same, by the input of the row before."""
    stamps = np.concatenate([log.time, log.time - delay])
    nothing, (y0, y1, force) = np.full(len(log.time), np.nan), (np.asarray(log[name]) for name in ("y0", "y1", "force"))
    held = force[np.clip(np.searchsorted(log.time, stamps, "right") - 1, 0, None)]
    both = {"y0": np.append(y0, nothing), "y1": np.append(nothing, y1), "force": held}
    said = np.append(np.isfinite(log.time), np.isfinite(y1) & (log.time >= delay))
    order = [k for k in np.argsort(stamps, kind="stable") if said[k]]
    return Recording(stamps[order], {name: values[order] for name, values in both.items()})


class TestDelayed:
    def test_rows_out_of_order_give_what_rows_in_order_give(self):
        order = list(range(30))
        # Two rows late by one, one by three.
        order[5], order[6] = order[6], order[5]
        order[20], order[21] = order[21], order[20]
        order.insert(14, order.pop(11))
        exact = kalman_in_order(ROWS)
        found = filters.scan(OUT_OF_ORDER, MODEL, taken(ROWS, order))
        assert not int(found.result)
        np.testing.assert_allclose(found.log_likelihood, exact.log_likelihood, rtol=1e-12)
        np.testing.assert_allclose([m[-1] for m in found.mean], [m[-1] for m in exact.mean], rtol=1e-10)
        np.testing.assert_allclose([s[-1] for s in found.std], [s[-1] for s in exact.std], rtol=1e-10)

    @pytest.mark.thorough
    def test_delayed_values_count_at_their_own_time(self):
        """A sensor whose value comes 0.25 s late, against rows in which it stands in its own place."""
        time = np.arange(24) * 0.1
        rng = np.random.default_rng(3)
        y0, y1, delay = rng.normal(size=24), rng.normal(size=24), 0.25
        y1[::3] = np.nan
        arriving = Recording(time, {"y0": y0, "y1": y1, "force": np.full(24, 0.7)})
        expected = kalman(MODEL, in_its_own_place(arriving, delay))
        filter_ = filters.Delayed(filters.Kalman(), {"y1": delay}, depth=8)
        found = filters.run(filter_, MODEL, arriving)
        np.testing.assert_allclose(found.log_likelihood, expected["log_likelihood"].sum(), rtol=1e-11)
        np.testing.assert_allclose([m[-1] for m in found.mean], expected["mean"][-1], rtol=1e-9)
        shown = np.asarray(found.info.innovation.y1)
        np.testing.assert_array_equal(np.isfinite(shown[3:]), np.isfinite(y1[3:]))
        # Of rows that come five times as fast, more than are kept come before it.
        with pytest.raises(FilterError, match="older than the rows that are kept"):
            filters.run(filter_, MODEL, Recording(0.2 * time, dict(arriving.channels)))

    def test_values_that_are_late_in_rows_that_are_late_count_at_their_own_time(self):
        """And in the row of a late value, rows that were already told are filtered anew: they have no innovation again."""
        time = np.arange(8) * 0.1
        y0, y1 = np.sin(time), np.cos(time)
        y0[5], y1[6] = np.nan, np.nan
        log = Recording(time, {"y0": y0, "y1": y1, "force": 0.7 + time})
        filter_, rows = filters.Delayed(filters.Kalman(), {"y1": 0.15}, depth=9), MODEL.rows(log)
        exact = kalman(MODEL, in_its_own_place(log, 0.15))
        for order in (np.arange(8), [0, 1, 3, 2, 4, 6, 5, 7]):
            found = filters.scan(filter_, MODEL, taken(rows, order))
            assert not int(found.result)
            np.testing.assert_allclose(found.log_likelihood, exact["log_likelihood"].sum(), rtol=1e-11)
            np.testing.assert_allclose([m[-1] for m in found.mean], exact["mean"][-1], rtol=1e-9)
            for shown, told in ((found.info.innovation, y0), (found.info.innovation_std, y0)):
                np.testing.assert_array_equal(np.isfinite(shown.y0[2:]), np.isfinite(told[order][2:]))
                np.testing.assert_array_equal(np.isfinite(shown.y1[2:]), np.isfinite(y1[order][2:]))

    def test_gradients_are_finite_where_a_delayed_value_is_from_before_the_first_row(self):
        """It is left out, and with it a step back in time that nobody takes."""
        time = np.arange(6) * 0.1
        log = Recording(time, {"y0": np.sin(time), "y1": np.cos(time), "force": np.full(6, 0.7)})
        filter_, rows = filters.Delayed(filters.Kalman(), {"y1": 0.25}, depth=4), MODEL.rows(log)
        arrays, rest = eqx.partition(MODEL, eqx.is_inexact_array)
        likelihood = lambda arrays: filters.scan(filter_, eqx.combine(arrays, rest), rows).log_likelihood
        assert all(np.isfinite(slope).all() for slope in jax.tree.leaves(jax.grad(likelihood)(arrays)))

    def test_what_is_too_late_is_said_and_left_out(self):
        found = filters.scan(OUT_OF_ORDER, MODEL, taken(ROWS, [0, *range(2, 11), 1, *range(11, 30)]))
        assert Result(int(found.result)) is Result.measurement_too_late and int(found.failed_at) == 10
        without = kalman_in_order(taken(ROWS, [0, *range(2, 30)]))
        np.testing.assert_allclose(found.log_likelihood, without.log_likelihood, rtol=1e-12)

    @pytest.mark.parametrize(
        "filter_", [filters.Guided(200), filters.Marginalised(200, ("x1",))], ids=["guided", "marginalised"]
    )
    def test_two_rows_at_one_time_leave_particles_alive(self, filter_):
        twice = DRAWN._replace(t=np.where(np.arange(25) == 6, DRAWN.t[5], DRAWN.t))
        found = filters.scan(filters.Delayed(filter_, depth=4), MODEL, twice, jax.random.key(0))
        exact = kalman_in_order(twice)
        assert not int(found.result)
        np.testing.assert_allclose(found.mean.x0[-1], exact.mean.x0[-1], atol=0.3)

    def test_particles_too_may_come_late(self):
        order = list(range(25))
        order[9], order[10] = order[10], order[9]
        filter_ = filters.ParticleFilter(2000)
        found = filters.scan(filters.Delayed(filter_, depth=3), MODEL, taken(DRAWN, order), jax.random.key(0))
        exact = kalman_in_order(DRAWN)
        assert abs(float(found.log_likelihood - exact.log_likelihood)) < 1.0

    @pytest.mark.parametrize(
        ("make", "message"),
        [
            (lambda: filters.Delayed(filters.Kalman(), {"y1": -0.1}), "delays of y1 = -0.1"),
            (lambda: filters.Delayed(filters.Kalman(), {"y1": 0.1}, depth=1), "depth = 1: must be .* at least 2"),
            (lambda: filters.Delayed(filters.Kalman(), {"speed": 0.1}).check(MODEL), "unknown name.* speed"),
            (
                lambda: filters.Delayed(filters.Kalman()).check(
                    eqx.tree_at(lambda m: m.process_noise, MODEL, ss.Discrete(MODEL.process_noise.law))
                ),
                "must be Continuous",
            ),
            (
                lambda: filters.Delayed(filters.Kalman()).check(ss.uncertain_inputs(MODEL, {"force": 0.1})),
                "give uncertain inputs a correlation time",
            ),
            (
                lambda: filters.Delayed(filters.ShrinkingProcess(filters.Kalman(), {"x0": 0.1})).check(MODEL),
                "ShrinkingProcess inside it takes no late rows",
            ),
        ],
    )
    def test_bad_input_is_named(self, make, message):
        with pytest.raises(InputError, match=message):
            make()


class TestVaryingNoise:
    @staticmethod
    def told(stds, **laws):
        """The model with an input that tells a standard deviation, and the recording with it."""
        model = ss.StateSpace(
            system=MODEL.system, transition=MODEL.transition_function, observation=MODEL.observation_function,
            process_noise=laws.get("process", MODEL.process_noise), measurement_noise=MODEL.measurement_noise,
            prior=MODEL.prior, inputs=("force", "told"),
        )  # fmt: skip
        return model, RECORDING.replace(told=stds)

    def test_the_filter_believes_what_the_input_says(self):
        """A gap in the data and a standard deviation of a thousand times are nearly the same."""
        stds = np.where(np.arange(30) % 2 == 0, 0.4, 400.0)
        model, recording = self.told(stds)
        found = filters.run(filters.VaryingNoise(filters.Kalman(), {"y0": "told"}), model, recording)
        gaps = np.array(RECORDING["y0"])
        gaps[1::2] = np.nan
        missing = kalman_in_order(ROWS._replace(y=ROWS.y._replace(y0=gaps)))
        np.testing.assert_allclose(np.stack(found.mean), np.stack(missing.mean)[:, :30], atol=2e-3)
        same, recording = self.told(np.full(30, 0.4))
        found = filters.run(filters.VaryingNoise(filters.Kalman(), {"y0": "told"}), same, recording)
        plain = kalman_in_order(ROWS)
        np.testing.assert_allclose(found.log_likelihood, plain.log_likelihood, rtol=1e-12)

    def test_process_noise_is_that_of_the_step_s_first_row(self):
        law = ss.Continuous(ss.Gaussian({"x0": 0.3, "x1": 0.3}))
        stds = np.full(30, 0.3)
        stds[12] = 5.0
        model, recording = self.told(stds, process=law)
        filter_ = filters.VaryingNoise(filters.Kalman(), process={"x1": "told"})
        found = filters.run(filter_, model, recording)
        plain = filters.run(filters.Kalman(), model, recording)
        np.testing.assert_allclose(found.mean.x1[:13], plain.mean.x1[:13], rtol=1e-12)
        assert float(found.std.x1[13]) > 1.2 * float(plain.std.x1[13])
        # Told of the time behind it, the row itself is the first to know.
        behind = filters.run(
            filters.VaryingNoise(filter_.inner, process={"x1": "told"}, process_of="after"), model, recording
        )
        np.testing.assert_allclose(behind.mean.x1[:12], plain.mean.x1[:12], rtol=1e-12)
        moved = filters.run(filter_, model, recording.replace(told=np.append(stds[1:], 0.3)))
        np.testing.assert_allclose(behind.std.x1, moved.std.x1, rtol=1e-12)
        with pytest.raises(InputError, match="process_of = 'later': must be one of 'before', 'after'"):
            filters.VaryingNoise(filters.Kalman(), process={"x1": "told"}, process_of="later")

    def test_a_number_that_is_no_spread_is_a_code(self):
        stds = np.full(30, 0.4)
        stds[4] = -1.0
        model, recording = self.told(stds)
        estimate = filters.run(filters.VaryingNoise(filters.Kalman(), {"y0": "told"}), model, recording, throw=False)
        assert int(estimate.failed_at) == 4 and int(estimate.result)

    def test_bad_input_is_named(self):
        with pytest.raises(InputError, match="name a channel"):
            filters.VaryingNoise(filters.Kalman())
        with pytest.raises(InputError, match="unknown name.* told"):
            filters.VaryingNoise(filters.Kalman(), {"y0": "told"}).check(MODEL)
        with pytest.raises(InputError, match="process noise is MultivariateGaussian"):
            filters.VaryingNoise(filters.Kalman(), process={"x0": "force"}).check(MODEL)


class TestUncertainInputs:
    def test_white_errors_are_process_noise_through_the_input_s_gain(self):
        """Of a linear model the exact answer has Q + (B dt s)^2, and R as it is where the input is not seen directly."""
        blind = eqx.tree_at(lambda m: m.system["D"], linear_model(2, 2, seed=3), jnp.zeros(2))
        recording = linear_recording(blind, rows=30)
        # The same by hand: a filter with the noise of each step added.
        B, Q = np.asarray(blind.system["B"]), np.asarray(blind.process_noise.law.matrix)
        steady = Recording(100.0 + 0.1 * np.arange(30), {n: recording[n] for n in recording.names})
        found = filters.run(filters.Kalman(), ss.uncertain_inputs(blind, {"force": 0.8}), steady)
        noisier = eqx.tree_at(lambda m: m.process_noise.law.matrix, blind, jnp.asarray(Q + 0.1 * 0.64 * np.outer(B, B)))
        exact = kalman(noisier, steady)
        np.testing.assert_allclose(found.log_likelihood, exact["log_likelihood"].sum(), rtol=1e-9)
        np.testing.assert_allclose(np.stack(found.mean[:2], axis=1), exact["mean"], rtol=1e-7, atol=1e-9)
        assert found.mean._fields == ("x0", "x1", "force_error") and len(found.time) == 30

    def test_an_error_that_is_seen_directly_is_one_and_the_same(self):
        """y = D (u + e): a sharp sensor of the input finds its error."""
        model = ss.StateSpace(
            transition=lambda s, t0, t1, x, u: x,
            observation=lambda s, t, x, u: record_type("Y", ("y",))(u.force + 0.0 * x.x),
            process_noise=None, measurement_noise={"y": 1e-3}, inputs=("force",),
            prior=ss.Prior(record_type("X", ("x",))(0.0), {"x": 1.0}),
        )  # fmt: skip
        recording = Recording(np.arange(20.0), {"force": np.ones(20), "y": np.full(20, 1.3)})
        found = filters.run(filters.Kalman(), ss.uncertain_inputs(model, {"force": 0.5}, {"force": 50.0}), recording)
        np.testing.assert_allclose(found.mean.force_error[-1], 0.3, atol=1e-3)

    def test_a_correlated_error_keeps_its_spread(self):
        model = ss.uncertain_inputs(MODEL, {"force": 0.8}, {"force": 2.0})
        blank = {name: np.full(30, np.nan) for name in ("y0", "y1")}
        found = filters.run(filters.Kalman(), model, RECORDING.replace(**blank))
        np.testing.assert_allclose(found.std.force_error, 0.8, rtol=1e-9)
        assert isinstance(model.process_noise, Together)

    def test_linear_inputs_are_off_by_the_error_throughout_a_step(self):
        model = ss.StateSpace(
            transition=lambda s, t0, t1, x, u: type(x)(x.x + (t1 - t0) * u.at(0.5 * (t0 + t1)).force),
            observation=lambda s, t, x, u: record_type("Y", ("y",))(x.x),
            process_noise=ss.Continuous(ss.Gaussian({"x": 1e-3})), measurement_noise={"y": 0.1},
            inputs=("force",), input_path="linear", prior=ss.Prior(record_type("X", ("x",))(0.0), {"x": 1.0}),
        )  # fmt: skip
        moved = ss.uncertain_inputs(model, {"force": 0.5})
        u = record_type("Inputs", ("force",))
        path = ss.LinearInput(0.0, 2.0, u(jnp.asarray(1.0)), u(jnp.asarray(3.0)))
        x = moved.transition(
            jnp.asarray(0.0), jnp.asarray(2.0), moved.states and type(moved.prior.mean)(0.0, 0.25), path
        )
        np.testing.assert_allclose(x, (2 * 2.25, 0.0), rtol=1e-12)

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            (({},), "std is empty"),
            (({"torque": 1.0},), "unknown name.* torque"),
            (({"force": -1.0},), "force = -1"),
            (({"force": 1.0}, {"force": 0.0}), "force = 0"),
        ],
    )
    def test_bad_input_is_named(self, arguments, message):
        with pytest.raises(InputError, match=message):
            ss.uncertain_inputs(MODEL, *arguments)

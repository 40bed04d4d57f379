"""Fisher information where it is known in closed form, pairs that trade, start states as nuisance, and the words."""

from collections import namedtuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import FilterError, InputError, Recording
from jaxveh import statespace as ss
from jaxveh.diagnostics.observability import from_sensitivities, observability_at
from jaxveh.estimators.observability import observe

RNG = np.random.default_rng(0)
DESIGN = RNG.normal(size=(30, 3))
NAMES = ("a", "b", "c")
SPREAD = np.array([0.5, 1.0, 2.0])


def test_a_linear_model_has_its_closed_form():
    found = observability_at(lambda z: jnp.asarray(DESIGN) @ z, jnp.zeros(3), NAMES, SPREAD)
    fisher = DESIGN.T @ DESIGN
    np.testing.assert_allclose(found.bounds.array(), np.sqrt(np.diag(np.linalg.inv(fisher))), rtol=1e-10)
    np.testing.assert_allclose(found.bounds_alone.array(), 1 / np.sqrt(np.diag(fisher)), rtol=1e-10)
    with_prior = np.linalg.inv(fisher + np.diag(1 / SPREAD**2))
    np.testing.assert_allclose(found.bounds_with_prior.array(), np.sqrt(np.diag(with_prior)), rtol=1e-10)
    scaled = fisher * SPREAD[:, None] * SPREAD
    np.testing.assert_allclose(found.information, scaled, rtol=1e-10)
    np.testing.assert_allclose(found.condition_number, np.linalg.cond(scaled), rtol=1e-9)
    np.testing.assert_allclose(found.singular_values**2, np.linalg.eigvalsh(scaled)[::-1], rtol=1e-9)


def test_start_states_as_nuisance_are_marginalised():
    found = observability_at(lambda z: jnp.asarray(DESIGN) @ z, jnp.zeros(3), ("a", "b"), SPREAD, nuisance=1)
    known = DESIGN.T @ DESIGN + np.diag([0.0, 0.0, 1 / SPREAD[2] ** 2])
    np.testing.assert_allclose(found.bounds.array(), np.sqrt(np.diag(np.linalg.inv(known))[:2]), rtol=1e-10)
    everything = observability_at(lambda z: jnp.asarray(DESIGN)[:, :2] @ z, jnp.zeros(2), ("a", "b"), SPREAD[:2])
    assert (everything.bounds.array() < found.bounds.array()).all()


def test_a_product_trades_and_the_words_name_both():
    time = np.linspace(0, 3, 50)
    predict = lambda z: jnp.concatenate([jnp.exp(z[0] + z[1]) * np.sin(time), 30 * z[2] * np.cos(time)])
    at = jnp.asarray([0.2, 0.3, 1.0])
    found = observability_at(jax.jit(predict), at, ("gain", "mass", "drag"), np.full(3, 0.1))
    assert found.condition_number > 1e20
    assert "gain" in found.trade()
    assert "mass" in found.trade()
    assert "drag" not in found.trade()
    assert "falling" in found.trade()
    assert "together these 3 parameters are unobservable here" in found.report()
    assert found.unobservable() == ("gain", "mass")
    assert found.observable() == ("drag",)
    # Opposite signs in the measurement: they rise together.
    ratio = jax.jit(lambda z: jnp.exp(z[0] - z[1]) * np.sin(time))
    assert "rising with it" in observability_at(ratio, jnp.zeros(2), ("gain", "mass"), np.full(2, 0.1)).trade()


def test_a_parameter_without_any_trace():
    found = observability_at(lambda z: 20 * z[:1] * jnp.ones(9), jnp.zeros(2), ("seen", "hidden"), np.ones(2))
    assert found.trade() == "hidden alone has no effect on the measurements"
    assert found.bounds.hidden > 1e100
    np.testing.assert_allclose(found.bounds_with_prior.hidden, 1.0)
    np.testing.assert_allclose(found.bounds.seen, 1 / 60, rtol=1e-9)
    assert "hidden: bound" in found.report()
    assert "unobservable" in found.report()


def test_fewer_measurements_than_parameters_leave_a_direction_unseen():
    found = from_sensitivities(np.array([[1.0, 1.0, 0.0]]), NAMES, np.ones(3))
    assert found.condition_number > 1e20
    assert found.singular_values.shape == (3,)
    assert found.directions.shape == (3, 3)
    assert (found.bounds.array() > 1e10).all()
    np.testing.assert_allclose(found.bounds_with_prior.array() ** 2, [1 - 1 / 3, 1 - 1 / 3, 1.0], rtol=1e-12)


def test_observability_errors():
    with pytest.raises(InputError, match=r"at \(3,\), spread \(2,\): must be \(3,\) for a, b, c"):
        observability_at(lambda z: z, jnp.zeros(3), NAMES, np.ones(2))
    with pytest.raises(InputError, match="spread = .*: must be positive"):
        observability_at(lambda z: z, jnp.zeros(3), NAMES, np.array([1.0, 0.0, 1.0]))
    with pytest.raises(FilterError, match="a sensitivity is not finite"):
        observability_at(lambda z: z / 0.0, jnp.zeros(3), NAMES, np.ones(3))


Line = namedtuple("Line", "x")
TIME = np.linspace(0.0, 2.0, 21)


def _line(law=None):
    """dx/dt = slope: the prediction is x0 + slope t, the information sum(t^2) / r^2."""
    plain = ss.StateSpace(
        system={"slope": jnp.asarray(2.0)},
        transition=lambda s, t0, t1, x, u: Line(x.x + s["slope"] * (t1 - t0)),
        observation=lambda s, t, x, u: ss.model.record("Y", {"y": x.x, "z": -x.x}),
        process_noise=None,
        measurement_noise=law or ss.Gaussian({"y": 0.1}),
        prior=ss.Prior(Line(1.0), {"x": 0.05}),
    )
    return ss.with_parameters(plain, lambda m: m.system["slope"], prior=0.25)


MEASURED = np.where(np.arange(21) % 3 == 0, np.nan, 1.0)


def test_a_model_along_a_recording():
    recording = Recording(TIME, {"y": MEASURED, "z": np.ones(21)})
    here = np.isfinite(MEASURED)
    found = observe(_line(), recording)
    information = (TIME[here] ** 2).sum() / 0.01
    assert found.names == ("slope",)
    np.testing.assert_allclose(found.spread.array(), [0.5])
    np.testing.assert_allclose(found.bounds.array(), information**-0.5, rtol=1e-10)
    free = observe(_line(), recording, known_start=False)
    design = np.stack([TIME[here], np.ones(here.sum())], axis=1) / 0.1
    full = design.T @ design + np.diag([0.0, 1 / 0.05**2])
    np.testing.assert_allclose(free.bounds.array(), np.sqrt(np.linalg.inv(full)[0, 0]), rtol=1e-10)


def test_correlated_sensors_are_whitened():
    matrix = np.array([[0.01, 0.006], [0.006, 0.04]])
    recording = Recording(TIME, {"y": MEASURED, "z": np.ones(21)})
    found = observe(_line(ss.MultivariateGaussian(("y", "z"), matrix)), recording)
    both = np.array([1.0, -1.0]) @ np.linalg.inv(matrix) @ np.array([1.0, -1.0])
    information = (TIME**2 * np.where(np.isfinite(MEASURED), both, 1 / 0.04)).sum()
    np.testing.assert_allclose(found.bounds.array(), information**-0.5, rtol=1e-10)


def test_a_model_without_parameters_is_refused():
    plain = ss.StateSpace(
        transition=lambda s, t0, t1, x, u: x, observation=lambda s, t, x, u: x, process_noise=None,
        measurement_noise={"x": 1.0}, prior=ss.Prior(Line(0.0), {"x": 1.0}))  # fmt: skip
    with pytest.raises(InputError, match="the model estimates no parameter"):
        observe(plain, Recording(TIME, {"x": TIME}))
    assert jax.tree.leaves(plain)


def _explosion():
    """dx/dt = slope x^2, which has no bound shortly after `TIME`."""
    plain = ss.StateSpace(
        system={"slope": jnp.asarray(0.4)},
        transition=lambda s, t0, t1, x, u: Line(x.x + s["slope"] * (t1 - t0) * x.x**2),
        observation=lambda s, t, x, u: ss.model.record("Y", {"y": x.x}),
        process_noise=None,
        measurement_noise=ss.Gaussian({"y": 0.1}),
        prior=ss.Prior(Line(1.0), {"x": 0.05}),
    )
    return ss.with_parameters(plain, lambda m: m.system["slope"], prior=0.25)


def test_drives_of_similar_length_share_a_program_and_what_comes_after_them_has_no_part():
    programs, model = [], _explosion()
    hear = lambda event, duration, **more: (
        programs.append(event) if event.endswith("backend_compile_duration") else None
    )
    jax.monitoring.register_event_duration_secs_listener(hear)
    for rows in (21, 17):
        before = len(programs)
        found = observe(model, Recording(TIME[:rows], {"y": MEASURED[:rows]}))

        def path(slope, rows=rows):
            x = [1.0]
            for dt in np.diff(TIME[:rows]):
                x.append(x[-1] + slope * dt * x[-1] ** 2)
            return np.array(x)

        slopes = (path(0.4 + 1e-6) - path(0.4 - 1e-6)) / 2e-6
        information = np.nansum(np.where(np.isnan(MEASURED[:rows]), np.nan, slopes / 0.1) ** 2)
        np.testing.assert_allclose(found.bounds.array(), information**-0.5, rtol=1e-7)
    assert len(programs) == before

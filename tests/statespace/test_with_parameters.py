"""Parameters as states: names, bijectors, priors, walks, gradients through the prior, trees of results, start values."""

from collections import namedtuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Recording, filters
from jaxveh import statespace as ss
from jaxveh._core.bijectors import Interval, Positive, Real
from jaxveh._core.parameter import parameter, positive
from jaxveh.statespace.parameters import put_parameters, start_from, with_parameters

Speed = namedtuple("Speed", "v")
Push = namedtuple("Push", "force")
Seen = namedtuple("Seen", "v")


class Engine(eqx.Module):
    gain: jax.Array = positive("1/kg")
    offset: jax.Array = parameter("m/s^2", scale=0.2)


class Vehicle(eqx.Module):
    engine: Engine
    share: jax.Array = parameter("-", Interval(0.0, 1.0))


def move(system, t0, t1, x, u):
    engine = system["car"].engine
    return Speed(x.v + (t1 - t0) * (engine.gain * u.force + engine.offset - 0.1 * system["car"].share * x.v))


def base(law=None, process=True):
    return ss.StateSpace(
        system={"car": Vehicle(Engine(2.0, 0.0), 0.5), "spare": jnp.asarray(1.0)},
        transition=move,
        observation=lambda s, t, x, u: Seen(x.v),
        process_noise=ss.Continuous(ss.Gaussian({"v": 0.1})) if process else None,
        measurement_noise={"v": 0.1},
        prior=ss.Prior(Speed(1.0), law or {"v": 0.3}),
        inputs=("force",),
    )


TIME = np.linspace(0, 2, 21)
RECORDING = Recording(TIME, {"force": np.sin(3 * TIME), "v": 1 + 0.7 * (1 - np.cos(3 * TIME))})
OF_CAR = lambda car: (car.engine.gain, car.engine.offset, car.share)
ALL = lambda m: OF_CAR(m.system["car"])


def test_chosen_leaves_leave_the_system_and_become_the_prior():
    model = with_parameters(base(), ALL, prior=0.1)
    assert model.states == ("v", "car_engine_gain", "car_engine_offset", "car_share")
    assert model.system["car"].engine.gain is None
    assert model.system["car"].share is None
    assert model.system["spare"] == 1.0
    np.testing.assert_allclose(model.prior.mean, [1.0, np.log(2.0), 0.0, 0.0], atol=1e-15)
    # On the logarithm; times the scale; through the logistic's slope, 0.5 (1 - 0.5).
    spreads = np.sqrt(np.diagonal(model.prior.covariance()))
    np.testing.assert_allclose(spreads, [0.3, 0.1, 0.1 * 0.2, 0.1 * 0.5 / 0.25])
    assert [type(p.domain) for p in model.chosen.parameters] == [Positive, Real, Interval]
    assert [p.name for p in model.chosen.parameters] == ["car.engine.gain", "car.engine.offset", "car.share"]
    assert model.process_noise.law.names == ("v",)


def test_the_joint_model_is_the_plain_one_with_these_parameters():
    plain, model = base(), with_parameters(base(), ALL, prior=0.1)
    u, x = Push(jnp.asarray(0.7)), type(model.prior.mean)(*[jnp.asarray(v) for v in (1.3, np.log(3.0), 0.4, 1.1)])
    moved = model.transition(0.0, 0.1, x, u)
    changed = eqx.tree_at(ALL, plain, [jnp.asarray(3.0), jnp.asarray(0.4), jnp.asarray(1 / (1 + np.exp(-1.1)))]).system
    np.testing.assert_allclose(moved.v, move(changed, 0.0, 0.1, Speed(1.3), u).v, rtol=1e-14)
    assert moved[1:] == x[1:]
    shown = model.report(0.0, x, u)
    np.testing.assert_allclose(shown, [1.3, 3.0, 0.4, 1 / (1 + np.exp(-1.1))], rtol=1e-14)
    np.testing.assert_allclose(put_parameters(model, shown)["car"].engine.gain, 3.0, rtol=1e-14)
    assert jax.tree.structure(put_parameters(model, shown)) == jax.tree.structure(plain.system)
    assert put_parameters(plain, None) is plain.system
    fields = shown._asdict()
    assert put_parameters(model, fields)["car"].engine.gain == put_parameters(model, shown)["car"].engine.gain
    own = [p.field for p in model.chosen.parameters]
    for field in own:
        for wrong in ({}, {field.replace("_", "."): 1.0}, {field.upper(): 1.0}):
            given = {name: value for name, value in fields.items() if name != field} | wrong
            with pytest.raises(InputError, match=rf"report has .*must have {field}, too: .* {', '.join(own)}\."):
                put_parameters(model, given)
    with pytest.raises(InputError, match="put_parameters: report = [0-9.]+: must be a NamedTuple or a mapping"):
        put_parameters(model, 9.0)


@pytest.fixture(scope="module")
def estimated():
    model = with_parameters(
        base(), ALL, prior={"gain": 0.3, "car.engine.offset": 1.0, "share": 0.2}, walk={"gain": 0.01}
    )
    return model, filters.run(filters.Unscented(), model, RECORDING)


def test_an_estimate_s_parameters_are_found_as_in_the_car(estimated):
    model, estimate = estimated
    assert model.process_noise.law.names == ("v", "car_engine_gain")
    tree, spread = estimate.parameters, estimate.parameters_std
    assert list(tree) == list(spread) == ["car.engine.gain", "car.engine.offset", "car.share"]
    assert tree.car.engine.gain.shape == (21,)
    np.testing.assert_array_equal(tree["car.engine.gain"], estimate.mean.car_engine_gain)
    np.testing.assert_array_equal(spread.car.share, estimate.std.car_share)
    assert 0 < float(tree.car.share[-1]) < 1
    assert float(spread.car.engine.gain[-1]) < 0.2 * float(spread.car.engine.gain[0])
    # The drive was made with a gain of about 2.1: dv/dt is 2.1 sin(3 t).
    assert float(tree.car.engine.gain[-1]) == pytest.approx(2.1, abs=0.3)
    np.testing.assert_array_equal(estimate["v"], estimate.mean.v)


def test_gradients_reach_start_values_through_the_prior(estimated):
    model, _ = estimated
    both = jax.jit(jax.value_and_grad(lambda m: filters.run(filters.Unscented(), m, RECORDING).log_likelihood))
    value = lambda m: float(both(m)[0])
    _, gradient = both(model)
    physical = model.report(0.0, model.prior.mean, None)
    for field in ("car_engine_gain", "car_engine_offset", "car_share"):
        nudged = lambda step, f=field: start_from(model, **{f: float(getattr(physical, f)) + step})
        difference = (value(nudged(1e-5)) - value(nudged(-1e-5))) / 2e-5
        (p,) = [p for p in model.chosen.parameters if p.field == field]
        through = getattr(gradient.prior.mean, field) / p.domain.slope(getattr(physical, field))
        assert abs(difference) > 1e-3
        np.testing.assert_allclose(through, difference, rtol=1e-6)


def test_start_from_takes_physical_values():
    model = with_parameters(base(), ALL, prior=0.1)
    started = start_from(model, car_engine_gain=5.0, car_share=0.25, v=-2)
    np.testing.assert_allclose(started.prior.mean, [-2.0, np.log(5.0), 0.0, np.log(0.25 / 0.75)])
    assert jax.tree.structure(started) == jax.tree.structure(model)
    np.testing.assert_allclose(start_from(base(), v=3.0).prior.mean.v, 3.0)
    with pytest.raises(InputError, match=r"start_from: unknown state\(s\) gain; there are: v, car_engine_gain"):
        start_from(model, gain=1.0)
    with pytest.raises(InputError, match=r"value = -1\.0: must be positive"):
        start_from(model, car_engine_gain=-1.0)
    low = start_from(ss.cast(model, jnp.float32), car_engine_gain=5.0)
    assert {leaf.dtype.name for leaf in jax.tree.leaves(low)} == {"float32"}


def test_a_domain_for_all_of_them():
    model = with_parameters(base(), lambda m: m.system["car"].engine.gain, prior=0.1, walk=0.02, domain=Real())
    np.testing.assert_allclose(model.prior.mean.car_engine_gain, 2.0)
    np.testing.assert_allclose(model.prior.law.std.car_engine_gain, 0.2)
    np.testing.assert_allclose(model.process_noise.law.std.car_engine_gain, 0.04)


def test_a_correlated_prior_stays_so():
    law = ss.MultivariateGaussian(("v",), [[0.09]])
    model = with_parameters(base(law), ALL, prior=0.1)
    np.testing.assert_allclose(model.prior.covariance(), np.diag([0.09, 0.01, 0.0004, 0.04]))
    estimate = filters.run(filters.Unscented(), model, RECORDING)
    plain = filters.run(filters.Unscented(), with_parameters(base(), ALL, prior=0.1), RECORDING)
    np.testing.assert_allclose(estimate.log_likelihood, plain.log_likelihood, rtol=1e-12)


@pytest.mark.parametrize("walk", [0.0, 0, {}, {"gain": 0.0}, np.float64(0), jnp.asarray(0.0)])
def test_a_walk_of_zero_is_a_constant(walk):
    model = with_parameters(base(process=False), lambda m: m.system["car"].engine.gain, prior=0.1, walk=walk)
    assert model.process_noise is None


def test_a_walk_s_spread_is_relative_and_per_root_second():
    model = with_parameters(base(), ALL, prior=0.1, walk={"offset": 0.5, "gain": 0.02})
    over = model.process_noise.over(jnp.asarray(0.25))
    np.testing.assert_allclose([over.std.v, over.std.car_engine_gain, over.std.car_engine_offset], [0.05, 0.01, 0.05])


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (dict(prior=0.0), r"prior spread of car\.engine\.gain = 0\.0: must be positive and finite"),
        (dict(prior={"gain": 0.1}), r"prior: no spread for car\.engine\.offset; there are: gain"),
        (
            dict(prior={"gain": 0.1, "offset": 0.1, "share": 0.1, "mass": 1.0}),
            r"prior: unknown name\(s\) mass; there are:",
        ),
        (dict(prior=0.1, walk=-0.1), r"walk spread of car\.engine\.gain = -0\.1: must be positive"),
        (dict(prior=0.1, walk={"gian": 0.1}), r"walk: unknown name\(s\) gian; there are: car\.engine\.gain, gain"),
        (
            dict(prior=0.1, where=lambda m: (m.system["car"].share, m.system["car"].share)),
            r"where picked car\.share twice",
        ),
        (dict(prior=0.1, where=lambda m: m.system["car"].mass), "where: .*mass"),
        (dict(prior=0.1, where=lambda m: m.measurement_noise.std), r"where picked measurement_noise\.std\..*m\.system"),
    ],
)
def test_errors(settings, message):
    with pytest.raises(InputError, match=message):
        with_parameters(base(), settings.pop("where", ALL), **settings)


def test_parameters_are_chosen_once_and_are_scalars():
    model = with_parameters(base(), ALL, prior=0.1)
    with pytest.raises(InputError, match="estimates parameters already"):
        with_parameters(model, lambda m: m.system["spare"], prior=0.1)
    wide = eqx.tree_at(lambda m: m.system["spare"], base(), jnp.ones(3))
    with pytest.raises(InputError, match="where picked spare, an array"):
        with_parameters(wide, lambda m: m.system["spare"], prior=0.1)


def test_what_holds_the_car_is_in_no_name():
    class Whole(eqx.Module):
        car: Vehicle = eqx.field(metadata=ss.kit.UNNAMED)
        spare: jax.Array = parameter()

    plain = base()
    model = ss.StateSpace(
        system=Whole(plain.system["car"], 1.0),
        transition=lambda s, t0, t1, x, u: move({"car": s.car}, t0, t1, x, u),
        observation=plain.observation_function,
        process_noise=plain.process_noise,
        measurement_noise=plain.measurement_noise,
        prior=plain.prior,
        inputs=plain.inputs,
    )
    short = with_parameters(model, lambda m: OF_CAR(m.system.car), prior=0.1)
    assert short.states == ("v", "engine_gain", "engine_offset", "share")
    assert short.system.car.engine.gain is None
    estimate = filters.run(filters.Unscented(), short, RECORDING)
    assert estimate.parameters.engine.gain.shape == (21,)
    long = filters.run(filters.Unscented(), with_parameters(base(), ALL, prior=0.1), RECORDING)
    np.testing.assert_allclose(estimate.log_likelihood, long.log_likelihood, rtol=1e-13)
    last = jax.tree.map(lambda leaf: leaf[-1], estimate.mean)
    np.testing.assert_allclose(put_parameters(short, last).car.share, last.share)

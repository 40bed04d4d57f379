"""Pushes as states: names, the step's order, what channels feel of them, beside chosen parameters, in a Kalman filter."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Recording, filters, run
from jaxveh import statespace as ss
from jaxveh._core.names import record_type

pytestmark = pytest.mark.product

Mass, Seen = record_type("Mass", ("place", "speed")), record_type("Seen", ("place", "acceleration"))


def fall(system, t0, t1, x, u):
    """Exact for a free mass under a held force."""
    dt, a = t1 - t0, u.force / system["mass"]
    return Mass(x.place + dt * x.speed + 0.5 * dt**2 * a, x.speed + dt * a)


def see(system, t, x, u):
    return Seen(x.place, u.force / system["mass"])


def model():
    return ss.StateSpace(
        system={"mass": jnp.asarray(2.0)},
        transition=fall,
        observation=see,
        report=lambda system, t, x, u: record_type("Report", ("place", "momentum"))(x.place, system["mass"] * x.speed),
        process_noise=None,
        measurement_noise=ss.Gaussian({"place": 0.01, "acceleration": 0.1}),
        prior=ss.Prior(Mass(0.0, 0.0), {"place": 1.0, "speed": 1.0}),
        inputs=("force",),
    )


U = record_type("U", ("force",))


def test_a_push_moves_the_mass_as_a_force_does():
    pushed = ss.with_disturbances(model(), {"speed": 3.0}, walk={"speed": 0.2}, felt={"speed": "acceleration"})
    assert pushed.states == ("place", "speed", "disturbance_speed")
    assert float(pushed.prior.law.std.disturbance_speed) == 3.0
    assert float(pushed.process_noise.law.std.disturbance_speed) == 0.2
    x = type(pushed.prior.mean)(1.0, 2.0, 0.7)
    found = pushed.transition(0.0, 0.5, x, U(1.0))
    np.testing.assert_allclose(found, (1.0 + 1.0 + 0.125 * 1.2, 2.0 + 0.5 * 1.2, 0.7), rtol=1e-14)
    np.testing.assert_allclose(pushed.observation(0.0, x, U(1.0)), (1.0, 0.5 + 0.7), rtol=1e-14)
    shown = pushed.report(0.0, x, U(1.0))
    assert shown._fields == ("place", "momentum", "disturbance_speed") and float(shown.momentum) == 4.0
    unfelt = ss.with_disturbances(model(), {"speed": 3.0})
    np.testing.assert_allclose(unfelt.observation(0.0, x, U(1.0)), (1.0, 0.5), rtol=1e-14)


def test_it_stands_beside_chosen_parameters_in_either_order():
    choose = lambda model: ss.with_parameters(model, lambda m: m.system["mass"], prior=0.2)
    push = lambda model: ss.with_disturbances(model, {"speed": 3.0})
    for joint in (choose(push(model())), push(choose(model()))):
        x = type(joint.prior.mean)(**{"place": 1.0, "speed": 2.0, "disturbance_speed": 0.7, "mass": 4.0})
        found = joint.transition(0.0, 0.5, x, U(2.0))
        assert (float(found.speed), float(found.mass)) == pytest.approx((2.6, 4.0), rel=1e-14)
        report = joint.report(0.0, found, U(2.0))
        assert float(report.momentum) == pytest.approx(4.0 * 2.6) and float(report.disturbance_speed) == 0.7
        assert float(ss.put_parameters(joint, report)["mass"]) == 4.0


def test_a_kalman_filter_finds_it_and_float32_stays():
    pushed = ss.with_disturbances(model(), {"speed": 3.0}, walk={"speed": 0.01})
    time = 0.02 * np.arange(200)
    place = 0.5 * 0.7 * time**2
    recording = Recording(time, {"place": place, "acceleration": np.full(200, np.nan), "force": np.zeros(200)})
    found = run(filters.Kalman(), pushed, recording)
    assert abs(float(found.mean.disturbance_speed[-1]) - 0.7) < 1e-3 < float(found.std.disturbance_speed[-1])
    small = ss.with_disturbances(ss.cast(model(), jnp.float32), {"speed": 3.0})
    assert {leaf.dtype for leaf in (*small.prior.mean, *small.prior.law.std)} == {np.dtype("float32")}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"prior": {"pace": 1.0}}, "unknown name.* pace"),
        ({"prior": {"speed": 0.0}}, "prior of speed = 0.0: must be positive"),
        ({"prior": {"speed": 1.0}, "walk": {"place": 1.0}}, "walk: unknown name.* place"),
        ({"prior": {"speed": 1.0}, "felt": {"speed": "a_y"}}, "felt: unknown name.* a_y"),
        ({"prior": {}}, "prior is empty"),
    ],
)
def test_bad_input_is_named(options, message):
    with pytest.raises(InputError, match=message):
        ss.with_disturbances(model(), **options)

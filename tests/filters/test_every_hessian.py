"""Second derivatives of every Gaussian filter's log-likelihood in two parameters are differences of its gradient.

The filters are those of `test_every_filter.py`; the models' angles and distances go through `numerics`, whose derivative rules
jax before 0.12 drops from the values that the backward pass of a scan keeps.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from test_every_filter import FILTERS, linear, linear_recording

from jaxveh import Recording, estimators, filters, numerics, sensors, vehicles
from jaxveh import statespace as ss
from jaxveh._core.names import record_type

ROWS = 4
USUAL = ("Extended", "Unscented, square root", "Student-t")
"""What the default run takes: two forms of the covariance, and a filter with a loop within its step."""

GAUSSIAN = [name for name, line in FILTERS.items() if line.differentiable and not line.drawn]


def test_what_is_left_out_draws_or_says_that_it_has_no_gradient():
    left = {name for name in FILTERS if name not in GAUSSIAN}
    assert all(FILTERS[name].drawn for name in left - {"Cubature, singular values"})
    assert set(USUAL) < set(GAUSSIAN)


def bent(system, t0, t1, x, u):
    dt, pull = t1 - t0, system["pull"]
    rate = u.force - pull * numerics.arctan(2 * x.x0) - 0.1 * x.x1
    return type(x)(x.x0 + dt * x.x1, x.x1 + dt * rate, x.x2)


def see(system, t, x, u):
    return record_type("Y", ("y0", "y1"))(
        numerics.arctan2(x.x0 + x.x2, 2 + x.x1), numerics.log(2 + numerics.hypot(x.x0, x.x2))
    )


def nonlinear():
    names = ("x0", "x1", "x2")
    model = ss.StateSpace(
        system={"pull": jnp.asarray(np.array(4.0))},
        transition=bent,
        observation=see,
        process_noise=ss.Continuous(ss.Gaussian({"x0": 0.1, "x1": 0.5, "x2": 0.05})),
        measurement_noise=ss.Gaussian({"y0": 0.1, "y1": 0.2}),
        prior=ss.Prior(record_type("X", names)(0.5, 0.1, 0.2), dict(zip(names, (0.3, 0.5, 0.1), strict=True))),
        inputs=("force",),
    )
    return model, lambda m: (m.system["pull"], m.measurement_noise.std.y0)


def straight():
    return linear(), lambda m: (m.system["B"], m.measurement_noise.std.y0)


def curvature_and_differences(filter_, model, rows, where, start, step):
    """(2, 2) each: the Hessian's columns, and central differences of the gradient, of one program."""

    def log_likelihood(parameters):
        values = [jnp.broadcast_to(p, jnp.shape(leaf)) for p, leaf in zip(parameters, where(model), strict=True)]
        return filters.scan(filter_, eqx.tree_at(where, model, values), rows, None).log_likelihood

    def along(given):
        parameters, direction = given
        return jax.jvp(jax.grad(log_likelihood), (parameters,), (direction,))

    # In turn, not as a batch, whose program takes longer to compile.
    start, step = np.asarray(start), np.asarray(step)
    moves = np.array([0.0, 1.0, -1.0, 2.0, -2.0])
    at = start + moves[:, None, None] * np.diag(step)
    in_turn = jax.jit(lambda given: jax.lax.map(along, given))
    gradients, columns = in_turn((at.reshape(-1, 2), np.tile(np.eye(2), (5, 1))))
    g = np.asarray(gradients).reshape(5, 2, 2)
    differences = (8 * (g[1] - g[2]) - (g[3] - g[4])) / (12 * step[:, None])
    return np.asarray(columns)[:2], differences


def check(found):
    columns, differences = found
    scale = np.sqrt(np.abs(np.outer(np.diagonal(differences), np.diagonal(differences))))
    np.testing.assert_allclose(columns / scale, differences / scale, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("name", [pytest.param(n, marks=[] if n in USUAL else pytest.mark.full) for n in GAUSSIAN])
def test_on_a_small_model(name):
    line = FILTERS[name]
    model, where = straight() if line.linear else nonlinear()
    rows = model.rows(linear_recording(model, rows=ROWS, seed=3))
    check(curvature_and_differences(line.make(), model, rows, where, (1.0 if line.linear else 4.0, 0.3), (1e-3, 1e-4)))


@pytest.mark.full
def test_on_the_car_of_the_readme():
    car, device = vehicles.passenger_car(), sensors.esc(yaw_rate=0.005, a_y=0.1)
    tyres = lambda car: (car.front.B, car.front.D, car.rear.B, car.rear.D)
    model = estimators.state_space(car, device, estimate=tyres, prior=0.1)
    time = 0.02 * np.arange(3)
    drive = {"yaw_rate": 0.4 + time, "a_y": 6.0 + 2 * time, "v_x": 25.0 + 0 * time, "steer": 0.1 + 0.3 * time}
    rows = model.rows(Recording(time, {name: drive[name] for name in (*model.channels, *model.inputs)}))
    where = lambda m: (m.system.vehicle.mass, m.measurement_noise.std.a_y)
    start = [float(leaf) for leaf in where(model)]
    check(curvature_and_differences(filters.Unscented(), model, rows, where, start, (1.0, 1e-4)))

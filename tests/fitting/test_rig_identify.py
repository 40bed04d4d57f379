"""What data do not identify stays at its start and counts in the others' errors; what they reject does not."""

from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, fitting, tyres
from jaxveh._core.parameter import parameter
from jaxveh.fitting.rig_data import with_leaf
from jaxveh.fitting.rig_identify import _below_one
from jaxveh.fitting.rig_stages import Stage, stages_of
from jaxveh.io import RigTable

NOISE = 30.0


class Two(tyres.AbstractTyre):
    """F_y = load (a + b + c camber^2) slip angle: a and b are one to the data, c shows by its camber."""

    a: jnp.ndarray = parameter("-", scale=10.0)
    b: jnp.ndarray = parameter("-", scale=1.0)
    c: jnp.ndarray = parameter("-", scale=1.0)

    def forces(self, contact, state=None):
        return tyres.Forces(F_y=contact.load * (self.a + self.b + self.c * contact.camber**2) * contact.slip_angle)


def law(a=8.0, b=0.5, c=0.0):
    return Two(jnp.asarray(a), jnp.asarray(b), jnp.asarray(c))


def rig(truth, seed=0, camber=0.08, rows=300):
    random = np.random.default_rng(seed)
    slip, lean = random.uniform(-0.1, 0.1, rows), random.uniform(-camber, camber, rows)
    load = random.uniform(2e3, 6e3, rows)
    contact = tyres.Contact(slip_angle=jnp.asarray(slip), load=jnp.asarray(load), camber=jnp.asarray(lean))
    force = np.asarray(truth.forces(contact).F_y) + NOISE * random.standard_normal(rows)
    return RigTable(slip_angle=slip, slip_ratio=0 * slip, load=load, camber=lean, F_y=force)


def test_the_least_known_stays_at_its_start_and_the_other_is_fitted():
    fit = fitting.fit_rig(law(), rig(law(14.0, 1.2)))
    held = np.isnan(fit.parameters_std.array())
    assert held.tolist() in ([True, False, True], [False, True, True])
    start = np.array([8.0, 0.5, 0.0])
    np.testing.assert_array_equal(fit.parameters.array()[held], start[held])
    # The sum is what the data know; the held one may be off by its own size, and the fitted one by as much.
    assert fit.parameters.array()[0] + fit.parameters.array()[1] == pytest.approx(15.2, abs=0.1)
    size = 1.0 if held[1] else 10.0
    assert 0.95 * size < fit.parameters_std.array()[~held][0] < 1.1 * size
    assert fit.stages[-1].coefficients == 1 and fit.stages[-1].converged


def test_intervals_hold_the_truth_that_the_start_is_not():
    truths = [(14.0, 1.2), (6.0, -0.4), (11.0, 1.5)]
    for seed, (a, b) in enumerate(truths):
        fit = fitting.fit_rig(law(), rig(law(a, b), seed))
        known = np.isfinite(fit.parameters_std.array())
        assert (np.abs(fit.parameters.array() - [a, b, 0.0]) < 1.96 * fit.parameters_std.array())[known].all()


def test_what_the_data_reject_is_not_put_back():
    """c = 0.1 +- 2.5 is not identified by its size, but no start of 20."""
    where = lambda law: law.c
    data = rig(law(14.0, 1.2, 0.1), seed=1)
    fit = fitting.fit_rig(law(14.0, 1.2, 20.0), data, where=where)
    assert np.isfinite(fit.parameters_std.c) and fit.parameters_std.c > 1.0
    assert abs(fit.parameters.c - 0.1) < 3 * fit.parameters_std.c
    near = fitting.fit_rig(law(14.0, 1.2, 1.0), data, where=where)
    assert np.isnan(near.parameters_std.c) and near.parameters.c == 1.0


def test_a_bounded_coefficient_may_be_held_too():
    fit = fitting.fit_rig(law(), rig(law(14.0, 1.2)), bounds={"b": (0.0, 3.0)})
    held = np.isnan(fit.parameters_std.array())
    assert held.sum() == 2 and fit.parameters.array()[held] == pytest.approx(np.array([8.0, 0.5, 0.0])[held])


def lateral():
    slip = np.linspace(-0.1, 0.1, 30)
    return RigTable(slip_angle=slip, slip_ratio=0 * slip, load=4e3 * (1 + slip), F_y=6e4 * slip)


def test_the_form_of_the_stiffness_over_load_is_held_unless_asked():
    tyre = tyres.typical_mf_tyre(4e3)
    names = lambda **chosen: (
        stages_of(tyre, lateral(), ("F_y",), chosen.get("where"), chosen.get("free", ()))[0].coefficients
    )
    assert "lateral.PKY4" not in names() and {"lateral.PKY1", "lateral.PKY2"} <= set(names())
    assert set(names(free=("lateral.PKY4",))) == {*names(), "lateral.PKY4"}
    assert names(where=("lateral.PKY4", "lateral.PKY1")) == ("lateral.PKY1", "lateral.PKY4")
    assert float(tyre.lateral.PKY4) == 2.0


def test_what_cannot_be_freed_is_named():
    with pytest.raises(InputError, match="free: unknown name.* lateral.PKY9; there are: "):
        fitting.fit_rig(tyres.typical_mf_tyre(4e3), lateral(), free=("lateral.PKY9",))


class Ends:
    """Data whose fit ends at a shape of 0.93 where it starts below 1, with losses of the two ends."""

    def __init__(self, below, beyond, bounds=()):
        self.below, self.beyond, self.chosen = below, beyond, SimpleNamespace(bounds=bounds)

    def descend(self, law, stage):
        return with_leaf(law, "lateral.RCY1", 0.93), 7, True

    def noise(self, law):
        return {}

    def loss(self, law, stage, noise):
        return self.below if float(law.lateral.RCY1) < 1 else self.beyond


@pytest.mark.parametrize(
    ("data", "shape", "steps"),
    [
        (Ends(102.0, 100.0), 0.93, 7),
        (Ends(105.0, 100.0), 1.12, 7),
        (Ends(90.0, 100.0), 0.93, 7),
        (Ends(102.0, 100.0, {"lateral.RCY1": (0.5, 2.0)}), 1.12, 0),
    ],
)
def test_of_two_ends_that_are_not_told_apart_the_weight_that_keeps_its_sign(data, shape, steps):
    tyre = with_leaf(tyres.typical_mf_tyre(4e3), "lateral.RCY1", 1.12)
    found, taken = _below_one(data, tyre, Stage("joint", ("F_y",), ("lateral.RCY1", "lateral.REY1"), np.ones(1, bool)))
    assert float(found.lateral.RCY1) == pytest.approx(shape) and taken == steps

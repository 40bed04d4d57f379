"""Rows that are too far apart for the steps between them are told."""

import contextlib
import warnings
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import JaxvehWarning, Recording, filters, statespace

DT = 0.1


class Place(NamedTuple):
    x: float


def settling(system, t, x, u):
    """A place that settles at the input, the faster the larger `fast` is."""
    return Place(-system["rate"] * u.fast * (x.x - u.goal))


def exactly(system, t0, t1, x, u):
    return Place(u.goal + jnp.exp(-system["rate"] * u.fast * (t1 - t0)) * (x.x - u.goal))


def seen(system, t, x, u):
    return Place(x.x)


def model(transition, **more):
    return statespace.StateSpace(
        system={"rate": jnp.asarray(1.0)}, transition=transition, observation=seen,
        inputs=("fast", "goal"), process_noise=statespace.Continuous(statespace.Gaussian({"x": 0.1})),
        measurement_noise=statespace.Gaussian({"x": 0.1}), prior=statespace.Prior(Place(0.0), {"x": 1.0}), **more,
    )  # fmt: skip


def drive(pole, dt=DT, rows=40):
    """One row in eight is fast."""
    fast = np.where(np.arange(rows) % 8 == 5, pole, 0.1)
    goal = np.sin(np.arange(rows))
    return Recording(dt * np.arange(rows), {"fast": fast, "goal": goal, "x": goal})


@contextlib.contextmanager
def silence():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def told(growth, dt=DT):
    return pytest.warns(
        JaxvehWarning, match=rf"rows {dt:g} s apart are too far for one step at t = [\d.]+ s: .* by {growth}"
    )


def test_a_step_that_multiplies_errors_is_told_with_time_and_remedy():
    growth = 1 - 5 + 25 / 2 - 125 / 6 + 625 / 24
    with told(f"{growth:.3g}".replace(".", r"\."), DT) as said:
        filters.run(filters.Extended(), model(statespace.Propagate(settling)), drive(50.0))
    text = str(said[0].message)
    assert "steps=4" in text and "StabilisedRK4" in text
    # One of the fast rows.
    assert round(float(text.partition("t = ")[2].partition(" s")[0]) / DT) % 8 == 5


@pytest.mark.parametrize(
    "holds",
    [
        statespace.Propagate(settling, steps=4),
        statespace.Propagate(settling, statespace.StabilisedRK4()),
        exactly,
    ],
)
def test_steps_that_hold_are_not_told(holds):
    with silence():
        filters.run(filters.Extended(), model(holds), drive(50.0))


def test_slow_motions_near_rows_and_whoever_asks_for_silence_are_left_alone():
    plain = model(statespace.Propagate(settling))
    with silence():
        filters.run(filters.Extended(), plain, drive(20.0))
        filters.run(filters.Extended(), plain, drive(500.0, dt=0.01))
        filters.run(filters.Extended(), plain, drive(50.0), throw=False)
        jax.jit(
            lambda rate: (
                filters.run(
                    filters.Extended(), eqx.tree_at(lambda m: m.system["rate"], plain, rate), drive(50.0)
                ).result
            )
        )(1.0)


def test_one_row_in_hundreds_is_found_by_its_input():
    whole = drive(0.1, rows=300)
    fast = np.where(np.arange(300) == 217, 50.0, 0.1)
    with pytest.warns(JaxvehWarning, match=r"at t = 21\.7 s"):
        filters.run(filters.Extended(), model(statespace.Propagate(settling)), whole.replace(fast=fast))


def test_a_gap_between_near_rows_is_told():
    whole = drive(8.0, dt=0.01, rows=400)
    cut = whole.rows(np.r_[0:134, 300:400])
    with silence():
        filters.run(filters.Extended(), model(statespace.Propagate(settling)), whole)
    with pytest.warns(JaxvehWarning, match=r"rows 1\.67 s apart are too far for one step at t = 1\.33 s"):
        filters.run(filters.Extended(), model(statespace.Propagate(settling)), cut)


def test_steps_within_other_models_are_looked_at():
    """Parameters as states, disturbances, uncertain inputs: each wraps the transition."""
    plain = model(statespace.Propagate(settling))
    for wrapped in (
        statespace.with_parameters(plain, lambda m: m.system["rate"], prior=0.1),
        statespace.with_disturbances(plain, {"x": 0.1}),
        statespace.uncertain_inputs(plain, {"goal": 0.1}),
    ):
        with told(".*"):
            filters.run(filters.Extended(), wrapped, drive(50.0))

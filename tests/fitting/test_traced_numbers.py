"""What a public function of `fitting`, `diagnostics`, `sweeps` and `observers` is given may be traced, each argument in its turn:
under jit and vmap it gives what it gives otherwise, or it is refused by name, with what to do.

What roads, manoeuvres and sensors are given is looked at in `core/test_traced_arguments`.
"""

import inspect

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from fit_systems import Torque, plain
from test_every_fit import FILTER, FRICTION, LEVELS, NOISE, PENDULUM, PIECES, YEARS, a_law, a_rig, nile

from jaxveh import InputError, Recording, diagnostics, filters, fitting, observers, sweeps, tyres
from jaxveh import statespace as ss

ROOMS = (fitting, diagnostics, sweeps, observers)
NOT_OF_NUMBERS = {
    "sweep": "a function", "read_sweep": "the name of a file", "check_car": "a car's file", "starting_tyre": "a rig table",
    "wrong_signs": "a rig table",
}  # fmt: skip
"""Functions that take no tree of arrays, and what they take."""

SOLVE = {"bootstrap", "fit_rig", "maximum_likelihood", "multiple_shooting", "prediction_error", "solve"}
"""Whose numbers `test_every_fit` and `test_bootstrap` compare, since they compile long. Here what is refused is."""

T = np.arange(200) * 0.05
WAVE, LATE = np.sin(T), np.sin(T - 0.2)
DRIVE = Recording(
    T, {"v_x": 20.0 + WAVE} | dict.fromkeys(("yaw_rate", "a_y", "steer", "a_x", "v_y", "brake_torque"), WAVE)
)
DRAWN = np.random.default_rng(0).normal(size=(3, 20, 2))
SLOPES = DRAWN[0]
PUSH = Torque(0.0)
SIDE = np.linspace(0.0, 5.0, 50)
TURNS = diagnostics.SteadyTurns(SIDE, 0.02 * SIDE, -0.01 * SIDE, 0.015 * SIDE)


class Told(eqx.Module):
    """What diagnostics read of an estimate."""

    info: filters.Info


def told():
    """Twenty rows of one channel, by a filter that is Gaussian and has particles."""
    of = type(FILTER.init(nile(), nile().row(0.0, {}, {"flow": 1.0}))[1].innovation)
    values, ones = jnp.asarray(SLOPES[:, 0]), jnp.ones(20)
    info = filters.Info(
        ones, of(values), of(ones), values**2, 50 * ones, jnp.zeros(20, int), values[:, None], 0 * values[:, None]
    )
    return Told(info)


def arguments():
    """What each function works with."""
    rig, recording, estimate = {"law": a_law(), "rig": a_rig()}, {"recording": DRIVE}, {"estimate": told()}
    fits = {"filter": FILTER, "model": nile(), "recordings": YEARS, "where": LEVELS, "prior": 0.3}
    pushed = ss.with_disturbances(plain(), {"rate": 1.0})
    problem, model = fitting.pose_rig(**rig, noise=NOISE, where=FRICTION, prior=0.02), plain()
    segments, shoots = fitting.cut(model, PIECES, 1.0), {"model": model, "where": PENDULUM, "prior": 0.5}
    return {
        "bootstrap": {"problem": problem, "key": jax.random.key(0), "count": 3}, "solve": {"problem": problem},
        "canonical": {"tyre": tyres.typical_mf_tyre(4000.0)}, "cut": {"model": model, "recordings": PIECES, "window": 1.0},
        "fit_rig": rig | {"where": FRICTION, "prior": 0.02}, "pose_rig": rig | {"where": FRICTION, "prior": 0.02, "noise": NOISE},
        "heavy_tails": {"residuals": np.random.default_rng(0).standard_t(2, 500)},
        "maximum_likelihood": fits, "pose_likelihood": fits, "pose_prediction_error": fits, "prediction_error": fits,
        "multiple_shooting": shoots | {"recordings": PIECES, "window": 1.0}, "pose_shooting": shoots | {"segments": segments},
        "ancestry": {"ancestors": np.tile(np.arange(10), (20, 1))}, "check_log": recording, "drive_numbers": recording,
        "braking_test": recording, "frequency_response": recording, "peaks": recording, "sine_with_dwell": recording,
        "steady_turns": recording, "step_response": recording, "nis": estimate, "nis_by_channel": estimate, "whiteness": estimate,
        "particle_health": estimate | {"particles": 100}, "understeer": {"turns": TURNS},
        "chi_squared_band": {"dof": 3.0}, "chi_squared_tails": {"value": 2.0, "dof": 3.0},
        "chi_squared_quantile": {"share": 0.5, "dof": 3.0}, "delay": {"time": T, "mean": WAVE, "truth": LATE},
        "delay_of_rows": {"mean": jnp.asarray(WAVE), "truth": jnp.asarray(LATE), "there": jnp.ones(200, bool), "most": 20},
        "from_sensitivities": {"jacobian": SLOPES, "names": ("a", "b"), "spread": np.ones(2)},
        "observability_at": {"predict": lambda z: SLOPES @ z, "at": jnp.ones(2), "names": ("a", "b"), "spread": np.ones(2)},
        "nees": {"error": DRAWN, "covariance": np.tile(np.eye(2), (3, 20, 1, 1))},
        "score_band": {"reference": WAVE, "mean": LATE, "std": np.ones(200)},
        "compare": {"a": SLOPES[:, 0] ** 2, "b": SLOPES[:, 1] ** 2}, "latin_hypercube": {"count": 4, "mass": (1.0, 2.0)},
        "sobol": {"count": 4, "mass": (1.0, 2.0)}, "linearised_step": {"model": model, "dt": 0.01},
        "contraction_rate": {"model": model, "gain": 0.5 * np.eye(2), "points": [(model.prior.mean, PUSH)], "dt": 0.01},
        "place_poles": {"model": model, "poles": [-1.0, -2.0], "dt": 0.01, "u": PUSH},
        "extended_state": {"model": pushed, "bandwidth": 2.0, "dt": 0.01, "u": PUSH},
    }  # fmt: skip


ARGUMENTS = arguments()
FUNCTIONS = {
    name: getattr(room, name) for room in ROOMS for name in room.__all__ if inspect.isfunction(getattr(room, name))
}


def is_number(leaf):
    return isinstance(leaf, float) or (eqx.is_array_like(leaf) and jnp.issubdtype(jnp.result_type(leaf), jnp.inexact))


def numbers(result):
    """The numbers of a result, but for keys and what is known while tracing."""
    keys = lambda leaf: jnp.issubdtype(jnp.result_type(leaf), jax.dtypes.prng_key)
    return [jnp.asarray(leaf) for leaf in jax.tree.leaves(result) if eqx.is_array_like(leaf) and not keys(leaf)]


def refusal(function, given):
    """The message of a refusal while tracing, or nothing."""
    try:
        jax.eval_shape(function, given)
    except InputError as error:
        return str(error)
    return ""


CASES = [
    pytest.param(name, argument, id=f"{name}-{argument}")
    for name in FUNCTIONS
    for argument, value in ARGUMENTS.get(name, {}).items()
    if any(map(is_number, jax.tree.leaves(value)))
]


def test_every_function_is_here():
    assert set(FUNCTIONS) == set(ARGUMENTS) | set(NOT_OF_NUMBERS)
    assert {case.values[0] for case in CASES} == set(ARGUMENTS) - {"ancestry"}, "whose ancestors are whole numbers"


@pytest.mark.parametrize(("name", "argument"), CASES)
def test_a_traced_argument_gives_the_same_or_is_refused_by_name(name, argument):
    function, given = FUNCTIONS[name], ARGUMENTS[name]
    traced, rest = eqx.partition(given[argument], is_number)
    traced = jax.tree.map(jnp.asarray, traced)
    call = lambda traced: numbers(function(**given | {argument: eqx.combine(traced, rest)}))
    twice = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), traced)
    slope = jax.grad(lambda traced: sum(map(jnp.sum, call(traced))))
    refusals = [refusal(call, traced), refusal(jax.vmap(call), twice)]
    if any(refusals):
        for told in (*refusals, refusal(slope, traced)):
            assert told.startswith(name.replace("multiple_shooting", "cut")), told
            assert "jit, vmap or grad traces" in told, told
        return
    if name not in SOLVE:
        plain_result = call(traced)
        for found in (jax.jit(call)(traced), [leaf[1] for leaf in jax.jit(jax.vmap(call))(twice)]):
            for one, other in zip(found, plain_result, strict=True):
                np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)

"""`filters.interleave`: filters that believe what the others said a row ago."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Recording, filters
from jaxveh._core.names import record_type
from jaxveh.statespace import Continuous, Gaussian, Prior, StateSpace

State = record_type("State", ("level",))
Sum = record_type("Measurements", ("sum",))


def stays(told, t0, t1, x, u):
    return x


def level(noise=None) -> StateSpace:
    """A level beside another that it is told of: their sum is measured."""
    return StateSpace(
        transition=stays, observation=lambda told, t, x, u: Sum(x.level + told), process_noise=noise,
        measurement_noise=Gaussian({"sum": 1.0}), prior=Prior(State(0.0), {"level": 1.0}),
    )  # fmt: skip


def turn(own, other, filter=None):
    filter = filter or filters.Cubature()
    tell = lambda belief, row, told: told | {own: belief.moments(level())[0].level}
    return filters.Turn(filter, level(), lambda told: told[other], tell)


TURNS = {"second": turn("a", "b"), "first": turn("b", "a")}
LOG = Recording(np.arange(6.0), {"sum": np.array([2.0, 1.5, np.nan, 2.5, 2.0, 1.0])})


def by_hand(sums):
    """The gains of a constant that is measured again and again; nothing is learned of a missing row."""
    a = b = 0.0
    seen, found = 0, []
    for sum_ in sums:
        if np.isfinite(sum_):
            seen += 1
            gain = 1.0 / (seen + 1.0)
            a, b = a + gain * (sum_ - b - a), b + gain * (sum_ - a - b)
        found.append((a, b, np.sqrt(1.0 / (seen + 1.0))))
    return np.array(found).T


def test_all_see_what_was_told_after_the_row_before_and_keep_their_names():
    found = filters.interleave(TURNS, LOG, {"a": 0.0, "b": 0.0}, keep=lambda belief: belief.covariance)
    a, b, std = by_hand(LOG["sum"])
    assert list(found.mean) == ["second", "first"]
    np.testing.assert_allclose(found.mean["second"].level, a, rtol=1e-9)
    np.testing.assert_allclose(found.mean["first"].level, b, rtol=1e-9)
    np.testing.assert_allclose(found.std["first"].level, std, rtol=1e-9)
    np.testing.assert_allclose(found.kept["second"][:, 0, 0], std**2, rtol=1e-9)
    np.testing.assert_allclose(found.told["a"], a, rtol=1e-9)
    assert int(found.result["first"]) == 0 and int(found.failed_at["first"]) == -1


def test_one_turn_alone_is_the_filter():
    noise = Continuous(Gaussian({"level": 0.3}))
    alone = {"only": filters.Turn(filters.Extended(), level(noise), lambda told: told, lambda belief, row, told: told)}
    found = filters.interleave(alone, LOG, 0.5)
    model = eqx.tree_at(lambda m: m.system, level(noise), jnp.asarray(0.5), is_leaf=lambda v: v is None)
    plain = filters.run(filters.Extended(), model, LOG)
    np.testing.assert_allclose(found.mean["only"].level, plain["level"], rtol=1e-12)
    np.testing.assert_allclose(found.std["only"].level, plain.std.level, rtol=1e-12)


def test_it_is_differentiated_batched_and_takes_particles():
    last = lambda start: filters.interleave(TURNS, LOG, {"a": start, "b": 0.0}).mean["first"].level[-1]
    here = jnp.asarray(0.3)
    slope = jax.jit(jax.grad(last))(here)
    np.testing.assert_allclose(slope, (last(here + 1e-4) - last(here - 1e-4)) / 2e-4, rtol=1e-6)
    np.testing.assert_allclose(jax.vmap(last)(jnp.array([0.0, 0.3])), [last(jnp.asarray(0.0)), last(here)], rtol=1e-9)
    mixed = TURNS | {"first": turn("b", "a", filters.ParticleFilter(4000))}
    found = filters.interleave(mixed, LOG, {"a": 0.0, "b": 0.0}, key=jax.random.key(0))
    np.testing.assert_allclose(found.mean["first"].level, by_hand(LOG["sum"])[1], atol=0.08)


def test_a_filter_that_fails_says_where():
    broken = TURNS | {"first": filters.Turn(
        filters.Cubature(), level(), lambda told: jnp.where(told["a"] > 0.0, jnp.inf, 0.0), TURNS["first"].tell
    )}  # fmt: skip
    found = filters.interleave(broken, LOG, {"a": 0.0, "b": 0.0})
    assert int(found.result["first"]) != 0 and int(found.failed_at["first"]) == 1


def test_what_does_not_go_together_is_said():
    with pytest.raises(InputError, match="turns is empty"):
        filters.interleave({}, LOG, 0.0)
    with pytest.raises(InputError, match=r"turns\['one'\] = Cubature: must be a filters.Turn"):
        filters.interleave({"one": filters.Cubature()}, LOG, 0.0)
    grows = {"one": TURNS["second"]._replace(tell=lambda belief, row, told: told | {"b": jnp.zeros(2)})}
    with pytest.raises(InputError, match=r"told\['b'\] was float64\[\] and is float64\[2\] after a row"):
        filters.interleave(grows, LOG, {"a": 0.0, "b": 0.0})
    with pytest.raises(InputError, match="sum"):
        filters.interleave(TURNS, Recording(np.arange(3.0), {"other": np.zeros(3)}), {"a": 0.0, "b": 0.0})

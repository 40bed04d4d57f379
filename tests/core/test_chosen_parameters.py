"""`where`: names, metadata, errors; bijectors; prior spreads; strong float arrays; result codes."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Result
from jaxveh._core.bijectors import Interval, Positive, Real
from jaxveh._core.errors import check, check_at_least, check_finite, check_one_of, check_positive, float_array
from jaxveh._core.names import as_mapping, record, record_type
from jaxveh._core.parameter import UNNAMED, parameter, pick, positive, prior_spread, put, resolve
from jaxveh._core.result import first_failure
from jaxveh.statespace import Gaussian


class Tyre(eqx.Module):
    B: jax.Array = positive("-")
    E: jax.Array = parameter("-", scale=0.5)
    share: jax.Array = parameter("-", Interval(0.0, 2.0))


class Car(eqx.Module):
    front: Tyre
    rear: Tyre
    table: dict
    extra: tuple
    noise: Gaussian
    law: object = abs


def car(B=9.0):
    tyre = Tyre(B, 0.0, 0.5)
    return Car(tyre, Tyre(8.0, -0.2, 1.5), {"k": jnp.asarray(3.0)}, (jnp.asarray(1.0),), Gaussian({"a_y": 0.1}))


def test_names_units_domains_come_from_the_tree():
    chosen = resolve(car(), lambda c: (c.rear.B, c.front.E, c.front.share, c.table["k"], c.extra[0], c.noise.std.a_y))
    assert [p.name for p in chosen] == ["rear.B", "front.E", "front.share", "table.k", "extra.0", "noise.std.a_y"]
    assert [p.field for p in chosen][:2] == ["rear_B", "front_E"]
    assert [type(p.domain) for p in chosen] == [Positive, Real, Interval, Real, Real, Positive]
    assert chosen[1].scale == 0.5
    assert pick(car(), chosen)[:2] == [8.0, 0.0]


class Loaded(eqx.Module):
    car: Car = eqx.field(metadata=UNNAMED)
    front: jax.Array = parameter("kg")


class Trip(NamedTuple):
    loaded: Loaded


class Driven(eqx.Module):
    trip: Trip = eqx.field(metadata=UNNAMED)


def test_names_leave_out_what_only_holds_the_car():
    """But not what stands in a NamedTuple there, which has no declarations of its own."""
    whole = Driven(Trip(Loaded(car(), 1.0)))
    chosen = resolve(whole, lambda w: (w.trip.loaded.car.front.B, w.trip.loaded.front))
    assert [p.name for p in chosen] == ["loaded.front.B", "loaded.front"]
    assert [p.path for p in chosen] == ["trip.loaded.car.front.B", "trip.loaded.front"]
    assert [p.unit for p in chosen] == ["-", "kg"]
    assert put(whole, chosen[:1], [jnp.asarray(1.0)]).trip.loaded.car.front.B == 1.0


class Twice(eqx.Module):
    first: Tyre = eqx.field(metadata=UNNAMED)
    second: Tyre = eqx.field(metadata=UNNAMED)


def test_parameters_that_would_share_a_name_have_their_whole_paths():
    two = Twice(car().front, car().rear)
    assert [p.name for p in resolve(two, lambda t: (t.first.B, t.second.B, t.second.E))] == ["first.B", "second.B", "E"]


def test_put_and_a_whole_part():
    chosen = resolve(car(), lambda c: c.rear)
    assert [p.name for p in chosen] == ["rear.B", "rear.E", "rear.share"]
    without = put(car(), chosen, [None] * 3)
    assert len(jax.tree.leaves(without)) == len(jax.tree.leaves(car())) - 3
    again = put(without, chosen, pick(car(), chosen))
    assert eqx.tree_equal(again, car())


@pytest.mark.parametrize(
    ("where", "message"),
    [
        (lambda c: c.middle.B, "where: .*middle.*must pick leaves of Car"),
        (lambda c: c.table["q"], "where: .*q.*must pick leaves of Car"),
        (lambda c: c.extra[3], "where: .*must pick leaves of Car"),
        (lambda c: (c.front.B, 3.0), r"where picked 3\.0: it must pick array leaves"),
        (lambda c: (c.front.B, c.front.B), r"where picked front\.B twice"),
        (lambda c: (), "where picked nothing from Car"),
        (lambda c: c.law, "where picked law.*must pick array leaves"),
    ],
)
def test_where_s_mistakes(where, message):
    with pytest.raises(InputError, match=message):
        resolve(car(), where)


@pytest.mark.parametrize(
    "relative", [0.1, {"B": 0.1, "E": 0.1, "share": 0.1}, {"front.B": 0.1, "E": 0.1, "share": 0.1}]
)
def test_prior_spread_by_domain(relative):
    chosen = resolve(car(), lambda c: (c.front.B, c.front.E, c.rear.share))
    spreads = prior_spread(chosen, pick(car(), chosen), relative)
    # On the logarithm; times the declared scale; through the logistic slope 1.5 * 0.5 / 2 at 1.5 of (0, 2).
    np.testing.assert_allclose(spreads, [0.1, 0.05, 0.1 * 1.5 / (1.5 * 0.5 / 2)])


@pytest.mark.parametrize(
    ("relative", "message"),
    [
        ({"E": 0.1}, r"no spread for front\.B; there are: E"),
        ({"B": 0.0, "E": 0.1}, r"prior spread of front\.B = 0\.0: must be positive and finite\. .*leave it out"),
        (-0.1, r"prior spread of front\.B = -0\.1"),
        ({"B": 0.1, "E": 0.1, "Q": 0.1}, r"unknown name\(s\) Q"),
        ({"B": 0.1, "E": 0.1, "rear.B": 0.1}, r"unknown name\(s\) rear\.B"),
    ],
)
def test_prior_spread_errors(relative, message):
    chosen = resolve(car(), lambda c: (c.front.B, c.front.E))
    with pytest.raises(InputError, match=message):
        prior_spread(chosen, pick(car(), chosen), relative)


def test_an_unbounded_parameter_at_zero_needs_a_scale():
    (p,) = resolve(car(), lambda c: c.front.E)
    with pytest.raises(InputError, match=r"prior spread of front\.E = 0\.0"):
        prior_spread((p._replace(scale=None),), [jnp.asarray(0.0)], 0.1)


@pytest.mark.parametrize(("domain", "physical"), [(Real(), -3.2), (Positive(), 0.04), (Interval(-1.0, 3.0), 2.4)])
def test_bijectors_round_trip_and_slope(domain, physical):
    unconstrained = domain.inverse(jnp.asarray(physical))
    np.testing.assert_allclose(domain.forward(unconstrained), physical, rtol=1e-14)
    np.testing.assert_allclose(domain.slope(jnp.asarray(physical)), jax.grad(domain.forward)(unconstrained), rtol=1e-12)
    np.testing.assert_allclose(jax.grad(domain.inverse)(jnp.asarray(physical)), 1 / domain.slope(physical), rtol=1e-12)


def test_bijectors_refuse_what_lies_outside():
    with pytest.raises(InputError, match=r"value = -1\.0: must be positive \(its domain\)"):
        Positive().inverse(jnp.asarray(-1.0))
    with pytest.raises(InputError, match=r"value = 2\.0: must be inside \(0\.0, 2\.0\)"):
        Interval(0.0, 2.0).inverse(jnp.asarray(2.0))
    for low, high in ((1.0, 1.0), (2.0, 1.0), (0.0, np.inf)):
        with pytest.raises(InputError, match="low must be less than high, and both finite"):
            Interval(low, high)


def test_checks_skip_tracers_and_name_the_value():
    assert jax.jit(lambda v: (check_positive("v", v), v)[1])(-1.0) == -1.0
    with pytest.raises(InputError, match=r"v = None: must be a real number, positive and finite\."):
        check_positive("v", None)
    for act, message in (
        (
            lambda: check_positive("mass", -2.0, "kg", "Look."),
            r"mass = -2\.0: must be positive and finite \(kg\)\. Look\.",
        ),
        (lambda: check_finite("g", np.inf), "g = inf: must be finite"),
        (lambda: check_at_least("N", 1, 2), "N = 1: must be at least 2"),
        (lambda: check_one_of("side", "up", ("left", "right")), "side = 'up': must be one of 'left', 'right'"),
        (
            lambda: check("v", np.array([1.0, -1.0]), lambda v: v > 0, "positive"),
            r"v = \[ 1\. -1\.\]: must be positive",
        ),
    ):
        with pytest.raises(InputError, match=message):
            act()


def test_float_array_is_strong_and_keeps_float_dtypes():
    weak = jax.jit(lambda: jnp.exp(1.0))()
    for value in (1, 0.5, np.int64(2), True, jnp.asarray(3), weak):
        out = float_array(value)
        assert out.dtype == jnp.float64
        assert not out.weak_type
    assert float_array(np.float32(2)).dtype == jnp.float32
    assert float_array(None) is None


def test_float_array_without_x64_makes_no_noise(float32, recwarn):
    assert float_array(np.float64(0.5)).dtype == jnp.float32
    assert float_array(np.zeros(3)).dtype == jnp.float32
    assert not recwarn.list


def test_records():
    assert record_type("A", ["x", "y"]) is record_type("A", ("x", "y"))
    assert record("A", {"x": 1, "y": 2})._asdict() == as_mapping(record("A", {"x": 1, "y": 2})) == {"x": 1, "y": 2}
    with pytest.raises(InputError, match=r"A has the field\(s\) x twice"):
        record_type("A", ["x", "y", "x"])
    with pytest.raises(InputError, match="scales = [0-9.]+: must be a NamedTuple or a mapping"):
        as_mapping(1.0, "scales")


def test_first_failure_and_messages():
    code, index = jax.jit(first_failure)(jnp.asarray([0, 0, 3, 0, 1], jnp.int32))
    assert (int(code), int(index)) == (3, 2)
    code, index = first_failure(jnp.zeros(3, jnp.int32))
    assert (int(code), int(index)) == (0, -1)
    assert all(result.message for result in Result)

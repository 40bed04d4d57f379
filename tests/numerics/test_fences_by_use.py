"""Where fences are placed by the uses of values: the program is the same, no loop is long, and nothing dear is computed twice."""

import random

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.extend import core

from jaxveh import numerics
from jaxveh.numerics import fences_by_use as by_use

pytestmark = pytest.mark.product

X = jnp.linspace(0.2, 1.7, 6)


def drawn(seed, count=60):
    """A random elementwise function of two arrays and a number, with calls, fences and equal values."""
    draw = random.Random(seed)
    unary = [jnp.sin, jnp.tanh, jnp.sqrt, lambda x: x**2, lambda x: -x, lambda x: 1 / (1 + x * x), jax.jit(jnp.cos)]
    binary = [jnp.add, jnp.multiply, jnp.subtract, jnp.maximum, lambda x, y: x / (2 + y * y), lambda x, y: y + x]
    plan = [
        (draw.random() < 0.4, draw.choice(unary), draw.choice(binary), draw.random(), draw.random())
        for _ in range(count)
    ]
    places = [draw.randrange(count) for _ in range(4)]

    def function(x, y, k):
        known = [x, y, k, x + k]
        for one, f, g, a, b in plan:
            recent = known[-8:]
            first, second = recent[int(a * len(recent))], recent[int(b * len(recent))]
            known.append(jnp.tanh(f(jnp.abs(first) + 0.1) if one else g(first, second)))
            if a < 0.1:
                known[-1] = numerics.fence(known[-1])
        return [*(known[4 + i] for i in places), known[-1], x]

    return function


def loops_of(program):
    """For each stored value, the variables that its loop computes; the rules of the module are not used."""
    jaxpr = program.jaxpr
    made = {one: equation for equation in jaxpr.eqns for one in equation.outvars}
    fenced = {e.outvars[0]: e.invars[0] for e in jaxpr.eqns if e.primitive.name == "jaxveh_fence"}
    is_variable = lambda one: not isinstance(one, core.Literal) and one in made and one not in fenced

    def loop(one):
        found, rest = set(), [one]
        while rest:
            here = rest.pop()
            if is_variable(here) and here not in found:
                found.add(here)
                rest += made[here].invars
        return found

    roots = dict.fromkeys([*fenced.values(), *(fenced.get(one, one) for one in jaxpr.outvars)])
    return [loop(one) for one in roots if is_variable(one)], made


def cost(equation):
    return 0 if equation.primitive.name in by_use.FREE else by_use.DEAR.get(equation.primitive.name, 1)


def costs(program):
    loops, made = loops_of(program)
    return [sum(cost(made[one]) for one in loop) for loop in loops]


@pytest.mark.parametrize("seed", range(12))
def test_a_program_stays_the_same_and_costs_less(seed):
    function = drawn(seed)
    given = X, X[::-1], jnp.asarray(0.3)
    before = jax.make_jaxpr(function)(*given)
    after = by_use.fence_by_use(before)
    for a, b in zip(core.jaxpr_as_fun(after)(*given), core.jaxpr_as_fun(before)(*given), strict=True):
        assert a.dtype == b.dtype
        np.testing.assert_allclose(a, b, 1e-13)
    assert max(costs(after)) <= by_use.LONGEST + 2 * max(by_use.DEAR.values())
    flat = jax.make_jaxpr(lambda *some: by_use._called(before.jaxpr, before.consts, some))(*given)
    assert sum(costs(after)) < sum(costs(flat))
    # Beyond what each needs once, loops compute no more than what a loop of its own would cost at each value.
    loops, made = loops_of(after)
    several = [one for one in made if sum(one in loop for loop in loops) > 1]
    assert all(cost(made[one]) * (sum(one in loop for loop in loops) - 1) <= by_use.OWN_LOOP for one in several)
    assert str(by_use.fence_by_use(before)) == str(after)


def of_one(function):
    program = by_use.fence_by_use(jax.make_jaxpr(function)(X))
    names = [one.primitive.name for one in program.jaxpr.eqns]
    return names, costs(program)


def test_what_two_loops_need_is_stored_if_it_is_dear():
    three = lambda x, f: [jnp.sin(f(x)), jnp.cos(f(x)), jnp.tanh(f(x))]
    dear, _ = of_one(lambda x: three(x, lambda x: jnp.exp(x) + 1))
    assert dear.count("exp") == 1 and dear.count("jaxveh_fence") == 1
    cheap, _ = of_one(lambda x: three(x, lambda x: x + 1))
    assert cheap.count("add") == 1 and "jaxveh_fence" not in cheap
    one_loop, _ = of_one(lambda x: jnp.exp(x) * (jnp.exp(x) + 1))
    assert one_loop.count("exp") == 1 and "jaxveh_fence" not in one_loop


def test_a_value_that_is_a_result_is_not_computed_again_for_another():
    names, _ = of_one(lambda x: [x + 1, (x + 1) * 2])
    assert names.count("jaxveh_fence") == 1


def test_a_long_sum_is_cut_and_what_nobody_needs_is_dropped():
    def long(x):
        jnp.exp(x) + jnp.sort(x)
        for k in range(500):
            x = x * 1.5 + k
        return x

    names, loops = of_one(long)
    assert "exp" not in names and "sort" not in names
    assert len(loops) > 10 and max(loops) <= by_use.LONGEST + 1


def test_what_is_not_elementwise_stays_as_it_is():
    def mixed(x):
        order = jnp.sort(x)
        chosen = jax.lax.cond(x[0] > 0.1, lambda x: x * 2, lambda x: x, order)
        return jnp.cumsum(chosen) + numerics.sin(jnp.linalg.inv(jnp.diag(x)))[0]

    program = jax.make_jaxpr(mixed)(X)
    np.testing.assert_allclose(core.jaxpr_as_fun(by_use.fence_by_use(program))(X)[0], mixed(X), 1e-13)

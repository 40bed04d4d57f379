"""A sweep's arrays stand where the design says, whatever the chunks, the memory and the devices."""

import functools
import re
import subprocess
import sys
import textwrap

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, Parameters, sweeps

KEY = jax.random.key(3)


def double(x):
    return 2.0 * x


def square(x):
    return x * x


DESIGN = sweeps.Design(scale=[1.0, 10.0], law={"double": double, "square": square}, shift=[0.0, 0.5, 1.0])


def run(point, key):
    drawn = jax.random.normal(key)
    return {"value": point.law(point.scale * drawn) + point.shift, "deep": {"pair": jnp.stack([drawn, point.shift])}}


@functools.cache
def swept():
    """The design with four seeds, which several tests look at."""
    return sweeps.sweep(run, DESIGN, 4, KEY)


def drawn_by(seeds):
    """What each seed draws."""
    return np.asarray(jax.jit(jax.vmap(jax.random.normal))(jax.random.split(KEY, seeds)))


def expected(seeds):
    drawn = drawn_by(seeds)
    scale, shift = np.array([1.0, 10.0])[:, None, None], np.array([0.0, 0.5, 1.0])[None, :, None]
    return np.stack([2.0 * (scale * drawn) + shift, (scale * drawn) ** 2 + shift], axis=1), drawn


def test_every_value_stands_in_its_place():
    found = swept()
    values, drawn = expected(4)
    assert found["value"].shape == (2, 2, 3, 4)
    np.testing.assert_allclose(found["value"], values, rtol=1e-14)
    assert found["deep.pair"].shape == (2, 2, 3, 4, 2)
    np.testing.assert_array_equal(found["deep.pair"][1, 0, 2, :, 0], drawn)
    np.testing.assert_array_equal(found["deep.pair"][..., 1], np.broadcast_to([[0.0], [0.5], [1.0]], (2, 2, 3, 4)))
    np.testing.assert_array_equal(found.at("value", law="square", scale=10.0), found["value"][1, 1])
    np.testing.assert_allclose(found.median("value"), np.median(values, axis=-1), rtol=1e-14)
    for q, line in zip((0.25, 0.75), found.quartiles("value"), strict=True):
        np.testing.assert_allclose(line, np.quantile(values, q, axis=-1), rtol=1e-14)


def test_chunks_make_the_same_and_report():
    said = []
    report = lambda done, total, stage: said.append((done, total, stage))
    whole, parts = swept(), sweeps.sweep(run, DESIGN, 4, KEY, batch=7, progress=report)
    for name in ("value", "deep.pair"):
        np.testing.assert_allclose(parts[name], whole[name], rtol=1e-14)
    assert said[:6] == [
        (n, 48, f"law {law}") for law, n in (*[("double", n) for n in (0, 7, 14, 21, 24)], ("square", 24))
    ]
    assert said[-1] == (48, 48, "law square")


def test_a_chunk_is_as_large_as_memory_holds():
    sizes = []

    def heavy(point, key):
        return {"sum": jnp.sum(jnp.sort(jax.random.normal(key, (20_000,)))) + point.shift}

    report = lambda done, total, stage: sizes.append(done)
    design = sweeps.Design(shift=[0.0, 1.0])
    whole = sweeps.sweep(heavy, design, 20, KEY)
    parts = sweeps.sweep(heavy, design, 20, KEY, memory=4e6, progress=report)
    np.testing.assert_allclose(parts["sum"], whole["sum"], rtol=1e-12)
    # A run takes at least its 20000 numbers of 8 bytes.
    assert len(sizes) > 2 and max(np.diff(sizes)) <= 4e6 / 1.6e5


def test_each_choice_is_compiled_once():
    traces = []

    def counted(point, key):
        traces.append(point.law)
        return {"value": point.law(jax.random.normal(key))}

    sweeps.sweep(counted, sweeps.Design(law={"double": double, "square": square}, n=[1.0, 2.0]), 5, KEY, batch=3)
    assert traces == [double, square]


def test_each_run_gets_its_own_part_of_the_data():
    drives = {"a": np.arange(6.0).reshape(2, 3, 1) + np.zeros((2, 3, 5)), "b": np.arange(6.0).reshape(2, 3)}
    design = sweeps.Design(law={"double": double, "square": square}, scale=[1.0, 10.0])

    def use(point, key, data):
        return {"x": point.law(point.scale * jnp.mean(data["a"])) + data["b"]}

    expected = np.arange(6.0).reshape(2, 3)
    for batch in (None, 4):
        found = sweeps.sweep(use, design, 3, KEY, data=drives, batch=batch)["x"]
        scaled = np.array([[1.0], [10.0]]) * expected
        np.testing.assert_allclose(found, [2 * scaled + expected, scaled**2 + expected], rtol=1e-14)
    with pytest.raises(InputError, match=r"data b has shape \(2, 3\): must begin with \(2, 4\) \(scale, seeds\)"):
        sweeps.sweep(use, design, 4, KEY, data={"b": drives["b"]})


def test_runs_on_data_alone_need_no_key():
    """As many seeds as the data have; a number each where both keys and data are given."""
    drives, design = np.arange(6.0).reshape(2, 3), sweeps.Design(scale=[1.0, 10.0])
    alone = sweeps.sweep(lambda point, drive: {"x": point.scale * drive}, design, data=drives)
    assert alone.seeds == 3
    np.testing.assert_array_equal(alone["x"], np.array([[1.0], [10.0]]) * drives)
    with_keys = sweeps.sweep(
        lambda point, key, drive: {"x": drive, "drawn": jax.random.normal(key)}, design, key=KEY, data=drives
    )
    np.testing.assert_array_equal(with_keys["x"], drives)
    np.testing.assert_array_equal(with_keys["drawn"][0], drawn_by(3))


def test_parameters_of_every_run_are_found_as_in_the_car():
    def fit(point, key):
        drawn = jax.random.normal(key)
        return {"parameters": Parameters({"front.B": drawn, "front.D": point.scale, "mass": 2 * drawn}), "result": 0}

    found = sweeps.sweep(fit, sweeps.Design(scale=[1.0, 10.0]), 4, KEY)
    assert list(found["parameters"]) == ["front.B", "front.D", "mass"]
    np.testing.assert_array_equal(found["parameters"].front.B, found["parameters.front.B"])
    np.testing.assert_array_equal(found["parameters"].front.D, [[1.0] * 4, [10.0] * 4])
    np.testing.assert_array_equal(found.at("parameters", scale=10.0).mass, found["parameters.mass"][1])
    np.testing.assert_array_equal(found.median("parameters").mass, found.median("parameters.mass"))
    with pytest.raises(InputError, match=r"value: unknown name\(s\) spread; there are: .*parameters\.front\.B"):
        found["spread"]


def test_a_design_without_axes_is_one_point():
    found = sweeps.sweep(lambda point, key: {"x": jax.random.normal(key)}, sweeps.Design(), 3, KEY)
    np.testing.assert_array_equal(found["x"], drawn_by(3))


ON_TWO = """
    import jax
    jax.config.update("jax_num_cpu_devices", 2)
    jax.config.update("jax_enable_x64", True)
    import numpy as np
    from jaxveh import sweeps
    run = lambda point, key: {"x": point.a * jax.random.normal(key)}
    design = sweeps.Design(a=[1.0, 2.0, 3.0])
    assert len(jax.devices()) == 2
    one = sweeps.sweep(run, design, 3, jax.random.key(3), devices=jax.devices()[:1])
    for batch in (None, 3):
        two = sweeps.sweep(run, design, 3, jax.random.key(3), batch=batch)
        np.testing.assert_allclose(two["x"], one["x"], rtol=1e-15)
"""


def test_two_devices_make_what_one_makes():
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(ON_TWO)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: sweeps.Design(a=[]), "axis a is empty"),
        (lambda: sweeps.Design(a=[1.0, np.nan]), r"axis a = .*must be finite"),
        (lambda: sweeps.Design(a=["PF", "UKF"]), "axis a = .*must be a sequence of numbers, or a mapping from labels"),
        (lambda: sweeps.sweep(run, DESIGN, 3), "sweep: give seeds and a key, .* or data"),
        (lambda: sweeps.compare(1.0, 2.0), "a is one number: must be the errors of several seeds"),
        (lambda: sweeps.sweep(lambda point: {}, DESIGN, 3, KEY), r"run takes \(point\): must take \(point, key\)"),
        (
            lambda: sweeps.sweep(run, DESIGN, 3, KEY, data=np.ones((2, 3, 3))),
            r"run takes .*: must take \(point, key, data\)",
        ),
        (lambda: sweeps.sweep(run, DESIGN, key=KEY), "seeds = None: must be a whole number"),
        (lambda: sweeps.sweep(run, DESIGN, 0, KEY), "seeds = 0: must be a whole number of at least 1"),
        (lambda: sweeps.sweep(run, DESIGN, 1, KEY, batch=0), "batch = 0: must be a whole number"),
        (
            lambda: sweeps.sweep(run, DESIGN, 1, KEY, memory=-1.0),
            r"memory = -1\.0: must be positive and finite \(bytes\)",
        ),
        (
            lambda: sweeps.sweep(lambda p, k: jnp.zeros(()), DESIGN, 1, KEY),
            "must be a mapping or a NamedTuple of arrays",
        ),
        (
            lambda: swept()["rmse"],
            r"value: unknown name\(s\) rmse; there are: deep.pair, value",
        ),
        (
            lambda: swept().at("value", law="cube"),
            "law = 'cube': the design has double, square",
        ),
        (
            lambda: swept().at("value", lw="double"),
            "axis = 'lw': the design has scale, law, shift",
        ),
    ],
)
def test_mistakes_are_named(call, message):
    with pytest.raises(InputError, match=message):
        call()


@pytest.mark.parametrize(
    ("name", "instead"),
    [
        ("front.B", "front_B"),
        ("a b", "a_b"),
        ("class", "class_"),
        ("_x", "x"),
        ("2x", "x2x"),
        ("", "x"),
        ("F_x [N]", "F_x_N"),
    ],
)
def test_a_name_that_no_point_can_have_is_refused_with_another(name, instead):
    with pytest.raises(InputError, match=f"axis {re.escape(repr(name))}: .* as in point.{instead}; write {instead}"):
        sweeps.Design(**{name: [1.0]})
    assert sweeps.Design(**{instead: [1.0]}).axes[0].name == instead


def test_the_seeds_own_axis_is_refused():
    with pytest.raises(InputError, match="axis seed: is the name of the seeds' own axis"):
        sweeps.Design(seed=[1.0])

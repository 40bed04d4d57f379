"""Every place of the package where a derivative is not what jax makes of arithmetic, and what tests it there.

A derivative rule, a primitive, a value without derivative, a loop of unknown length or a callback that is not in `PLACES` fails.
Fences (`numerics/fences.py`) stand here where they are made; who uses them needs no line.
"""

import ast
from pathlib import Path

import pytest

import jaxveh

SPECIAL = {
    "Primitive",
    "approx_max_k",
    "bitcast_convert_type",
    "callback",
    "closure_convert",
    "custom_batching",
    "custom_gradient",
    "custom_jvp",
    "custom_linear_solve",
    "custom_root",
    "custom_vjp",
    "diffeqsolve",
    "filter_custom_jvp",
    "filter_custom_vjp",
    "fixed_point",
    "implicit_jvp",
    "io_callback",
    "least_squares",
    "linear_call",
    "minimise",
    "optimization_barrier",
    "pure_callback",
    "root_find",
    "stop_gradient",
    "while_loop",
}

EVERY = "tests/numerics/test_every_derivative.py"
HESSIAN = "tests/filters/test_every_hessian.py"
SCORES = "tests/filters/test_choosing.py"
WRITTEN_OUT = "tests/numerics/test_written_out.py"
BATCH_LAST = "tests/numerics/test_batch_last.py"
FITS = "tests/fitting/test_fitted_derivatives.py"
ROOMS = {"fitting": FITS}
"""Rooms of solvers, all of whose derivatives are those of an optimum."""

PLACES = {
    "cli/app.py": {"callback": "of a command, not of jax"},
    "experiments/sideslip_review/contestants.py": {
        "custom_batching": "particle filters one by one; nothing is differentiated"
    },
    "estimators/mass/forgetting.py": {"least_squares": "a name: recursive least squares, a filter"},
    "experiments/tyre_apf/saturated.py": {"least_squares": "a fit, whose values alone are used"},
    "filters/adaptive_number.py": {
        "stop_gradient": "how many particles are drawn, and the draws that say so: whole numbers"
    },
    "filters/auxiliary.py": {
        "stop_gradient": "the look-ahead, whose derivative cancels: gained in the choice, lost in the weights"
    },
    "filters/choosing.py": {"stop_gradient": "the draw of ancestors, whole numbers"},
    "filters/looking_ahead.py": {"stop_gradient": "a remark, which is a code"},
    "filters/particle_belief.py": {"stop_gradient": "the base of moments, which cancels"},
    "filters/transport.py": {"stop_gradient": "the largest logarithm, which cancels in the sum of exponentials"},
    "numerics/blocks.py": {"filter_custom_jvp": EVERY},
    "numerics/by_batch.py": {"Primitive": WRITTEN_OUT},
    "numerics/elementary.py": {"custom_jvp": EVERY, "stop_gradient": EVERY, "bitcast_convert_type": EVERY},
    "numerics/fences.py": {
        "Primitive": EVERY,
        "optimization_barrier": EVERY,
        "custom_jvp": HESSIAN,
        "bitcast_convert_type": "the condition of a branch that is always taken",
    },
    "numerics/float_bits.py": {"bitcast_convert_type": EVERY},
    "numerics/resampling.py": {"stop_gradient": EVERY},
    "numerics/scan_last.py": {"Primitive": BATCH_LAST},
    "numerics/roots.py": {"stop_gradient": EVERY, "while_loop": EVERY},
    "numerics/steps_last.py": {"Primitive": BATCH_LAST},
    "numerics/tangents.py": {"Primitive": SCORES},
    "numerics/triangular.py": {"custom_jvp": EVERY},
    "numerics/words.py": {"bitcast_convert_type": "whole numbers of random words"},
    "numerics/written_out.py": {"custom_jvp": WRITTEN_OUT},
    "simulation/meter.py": {"callback": "tells how far a run is; no number comes back"},
    "simulation/solve.py": {"diffeqsolve": "tests/simulation, by the adjoint that is asked for"},
}


def names_in(text):
    """Names and attributes, wherever they are used or imported."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr
        elif isinstance(node, ast.ImportFrom):
            yield from (alias.name for alias in node.names)


def found():
    root = Path(jaxveh.__file__).parent
    for path in sorted(root.rglob("*.py")):
        special = SPECIAL & set(names_in(path.read_text(encoding="utf-8")))
        place = path.relative_to(root)
        if special and place.parts[0] not in ROOMS:
            yield place.as_posix(), special


@pytest.mark.whole
def test_every_place_is_listed_with_its_test():
    assert {path: sorted(special) for path, special in found()} == {p: sorted(lines) for p, lines in PLACES.items()}


def test_the_tests_that_are_named_exist():
    root = Path(__file__).parents[2]
    reasons = [where for lines in PLACES.values() for where in lines.values()] + list(ROOMS.values())
    named = {where.split(",")[0] for where in reasons if where.startswith("tests/")}
    assert named and all((root / where).exists() for where in named)


EXTREMES = {"max": "largest", "min": "smallest"}
NOT_DIFFERENTIATED = {"statespace/cramer_rao.py": "slopes that are compared with one another"}


def extremes_in(text):
    """Lines of `jnp.max` and `jnp.min` whose derivative may be taken: not those that are compared, are whole numbers (`result`),
    or have no derivative."""
    tree = ast.parse(text)
    above = {inner: outer for outer in ast.walk(tree) for inner in ast.iter_child_nodes(outer)}
    for node in ast.walk(tree):
        called = getattr(node, "func", None)
        if isinstance(called, ast.Attribute) and called.attr in EXTREMES and getattr(called.value, "id", "") == "jnp":
            outer = above[node]
            codes = isinstance(node.args[0], ast.Attribute | ast.Name) and ast.unparse(node.args[0]).endswith("result")
            stopped = "stop_gradient" in ast.unparse(outer).partition("(")[0]
            if not (isinstance(outer, ast.Compare) or codes or stopped):
                yield node.lineno


def test_extremes_have_a_finite_derivative():
    """That of `jnp.max` is NaN where the largest value is computed twice, with roundings that differ."""
    assert list(extremes_in("jnp.max(x)\njnp.max(x) > 0\njax.lax.stop_gradient(jnp.max(x))\nf(jnp.min(x))")) == [1, 4]
    root = Path(jaxveh.__file__).parent
    where = {path.relative_to(root).as_posix(): [*extremes_in(path.read_text("utf-8"))] for path in root.rglob("*.py")}
    assert {path for path, lines in where.items() if lines} == set(NOT_DIFFERENTIATED), f"use numerics: {EXTREMES}"

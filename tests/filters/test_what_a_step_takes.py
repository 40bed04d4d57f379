"""What `scan`, and `init` and `step` of every filter, refuse by name: models, rows and beliefs of another kind or shape.

Each filter in its turn; what is wrong is derived from what is right: each part of a row and of a belief, in another form.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from test_every_filter import FILTERS, linear, recordings, straight

from jaxveh import InputError, filters
from jaxveh import statespace as ss
from jaxveh._core.names import record

MODEL, KEY = linear(), jax.random.key(0)
ROWS = MODEL.rows(recordings("linear")[0])
FIRST, SECOND = (jax.tree.map(lambda leaf, k=k: leaf[k], ROWS) for k in (0, 1))


def narrow(tree):
    return jax.tree.map(lambda leaf: leaf.astype(jnp.float32) if eqx.is_inexact_array(leaf) else leaf, tree)


def wrong_fields(row, part):
    """A part of a row without a field, with one too many, and of other kinds."""
    fields = getattr(row, part)._asdict()
    name = next(iter(fields))
    rest = {one: value for one, value in fields.items() if one != name}
    for other in (
        record("Other", rest),
        record("Other", fields | {"other": row.t}),
        fields,
        tuple(row),
        None,
        "text",
        3.0,
    ):
        yield f"row.{part} = ", row._replace(**{part: other})


def wrong_numbers(row, part, name, value):
    """A number of a row that is none, or of another shape or precision."""
    put = lambda other: (
        row._replace(t=other) if part == "t" else row._replace(**{part: getattr(row, part)._replace(**{name: other})})
    )
    place = "row.t" if part == "t" else f"row.{part}.{name}"
    for other in ("text", None, [1.0, 2.0], 1.0, 1, np.array("text")):
        yield f"{place} = ", put(other)
    yield f"{place} has the shape ", put(jnp.stack([value, value]))
    yield f"{place} = ", put(value.astype(jnp.float32))
    yield f"{place} = ", put(jnp.asarray(1))


def wrong_rows(row):
    for other in (None, "row", [1, 2], tuple(row), row._asdict(), recordings("linear")[0], filters.Unscented(), ss.Row):
        yield "row = ", other
    for part in ("u", "y"):
        yield from wrong_fields(row, part)
        for name, value in getattr(row, part)._asdict().items():
            yield from wrong_numbers(row, part, name, value)
    yield from wrong_numbers(row, "t", "t", row.t)


def refused(start, call, *told):
    """The refusal starts with a name, and then with what was wrong."""
    with pytest.raises(InputError) as raised:
        call(*told)
    assert str(raised.value).partition(": ")[2].startswith(start), str(raised.value)


def test_every_wrong_row_is_named():
    """Rows are looked at before anything of a filter: one filter shows it for `init`, `step` and `scan`."""
    belief, _ = filters.Kalman().init(MODEL, FIRST)
    for start, row in wrong_rows(SECOND):
        refused(start, filters.Kalman().init, MODEL, row)
        refused(start, filters.Kalman().step, MODEL, belief, row)
    for start, rows in wrong_rows(ROWS):
        refused(start.replace("row", "rows", 1), filters.scan, filters.Kalman(), MODEL, rows)
    refused("rows.t has the shape ()", filters.scan, filters.Kalman(), MODEL, FIRST)
    refused(
        "rows.t has the shape (0,)", filters.scan, filters.Kalman(), MODEL, jax.tree.map(lambda leaf: leaf[:0], ROWS)
    )


def test_a_float32_model_takes_no_float64():
    model = ss.cast(MODEL, jnp.float32)
    belief, _ = filters.Kalman().init(model, narrow(FIRST))
    refused(
        "row.t = an array of float64 of shape (): must be an array of float32",
        filters.Kalman().step,
        model,
        belief,
        SECOND,
    )
    refused(
        "rows.t = an array of float64 of shape (25,): must be an array of float32",
        filters.scan,
        filters.Kalman(),
        model,
        ROWS,
    )


def wrong_beliefs(belief):
    for other in (None, "belief", (belief, 1), [belief], 3.0, FIRST, type(belief)):
        yield "belief = ", other
    yield "belief.", narrow(belief)


@pytest.mark.parametrize("name", FILTERS)
def test_every_filter_names_another_row_model_and_belief(name):
    """Shapes alone: nothing is computed."""
    filter = FILTERS[name].make()
    belief = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), abstract(filter, MODEL))
    for model in (None, "model", ROWS, ss.StateSpace):
        refused("model = ", filter.init, model, FIRST, KEY)
        refused("model = ", filter.step, model, belief, SECOND)
    for start, row in list(wrong_rows(SECOND))[::7]:
        refused(start, filter.init, MODEL, row, KEY)
        refused(start, filter.step, MODEL, belief, row)
    for start, other in wrong_beliefs(belief):
        refused(start, filter.step, MODEL, other, SECOND)
    jax.eval_shape(lambda belief: filter.step(MODEL, belief, SECOND)[0], belief)


@pytest.mark.parametrize("name", [name for name, line in FILTERS.items() if not line.seldom])
def test_a_belief_of_another_filter_or_model_is_no_belief_of_this_one(name):
    filter = FILTERS[name].make()
    own = abstract(filter, MODEL)
    others = [abstract(FILTERS[one].make(), MODEL) for one in ("Unscented", "Ensemble", "bootstrap", "fixed lag")]
    # Of one family, the numbers may be used in each other's steps.
    others = [other for other in others if type(other) is not type(own)]
    assert len(others) >= 3
    if not set(vars(filter)) & {"names", "linear", "groups", "extra", "most", "delays", "scales", "bins"}:
        others.append(abstract(filter, linear_of_other_names()))
    for other in others:
        told = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), other)
        refused("belief", filter.step, MODEL, told, SECOND)


def test_init_and_scan_check_the_model():
    bent = eqx.tree_at(lambda m: m.system["pull"], straight(), jnp.asarray(np.array(9.0)))
    rows = bent.rows(recordings("linear")[0])
    for call, given in ((filters.scan, rows), (type(filters.Kalman()).init, jax.tree.map(lambda leaf: leaf[0], rows))):
        with pytest.raises(InputError, match="Kalman: state x1 is not a linear function"):
            call(filters.Kalman(), bent, given)


def linear_of_other_names():
    """The same model, whose first state has another name."""
    names = ("position", "x1", "x2")
    kind = type(record("State", dict.fromkeys(names)))
    rename = lambda x: kind(*x)
    inner = MODEL
    back = type(inner.prior.mean)
    return ss.StateSpace(
        system=inner.system,
        transition=lambda s, t0, t1, x, u: rename(inner.transition_function(s, t0, t1, back(*x), u)),
        observation=lambda s, t, x, u: inner.observation_function(s, t, back(*x), u),
        process_noise=ss.Continuous(ss.Gaussian({"x1": 0.1})),
        measurement_noise=inner.measurement_noise,
        prior=ss.Prior(rename(inner.prior.mean), dict.fromkeys(names, 1.0)),
        inputs=inner.inputs,
    )


def abstract(filter, model):
    """The shapes of the belief after a first row."""
    return jax.eval_shape(lambda row: filter.init(model, row, KEY if filter.needs_key else None)[0], FIRST)

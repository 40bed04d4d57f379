"""A batch of runs is those runs one by one, and what of it is written out in scalars: each of `FILTERS`, smoothed, too."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from test_every_filter import FILTERS, MODELS, recordings

from jaxveh import Result, filters
from jaxveh.filters.smoothing.parallel import parallel_smoother
from jaxveh.filters.smoothing.rauch_tung_striebel import rauch_tung_striebel
from jaxveh.statespace import Info, Smoothing, kit
from jaxveh.statespace.capabilities import who_lacks

BATCHED = [name for name, line in FILTERS.items() if who_lacks(line.make(), "written_out") is None]
SMOOTHED = [name for name in BATCHED if kit.smoothing_of(FILTERS[name].make()) is Smoothing.gaussian]


@pytest.fixture(scope="module", autouse=True)
def every_batch_is_worth_it():
    """Batches of these few rows are written out, too."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("jaxveh.statespace.driver.WORTH", 1)
        jax.clear_caches()
        yield
    jax.clear_caches()


def rows_and_model():
    model = MODELS["linear"]()
    rows = [model.rows(recording) for recording in recordings("linear")]
    return model, jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(leaf) for leaf in leaves]), *rows)


def same(found, wanted, rtol=1e-9, atol=1e-10):
    for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        np.testing.assert_allclose(a, b, rtol, atol)


# All of them stand in test_every_filter in a batch, against recorded and exact numbers.
@pytest.mark.product
@pytest.mark.parametrize("name", BATCHED)
def test_a_batch_is_its_runs(name):
    filter_, (model, rows) = FILTERS[name].make(), rows_and_model()
    shifted = eqx.tree_at(lambda m: m.prior.mean, model, jax.tree.map(lambda x: x + 0.1, model.prior.mean))
    models = jax.tree.map(lambda a, b: jnp.stack([a, b]) if eqx.is_array(a) else a, model, shifted)
    batch = eqx.filter_vmap(lambda model, rows: filters.scan(filter_, model, rows))(models, rows)
    for i, one in enumerate((model, shifted)):
        alone = filters.scan(filter_, one, jax.tree.map(lambda leaf, i=i: leaf[i], rows))
        same(jax.tree.map(lambda leaf, i=i: leaf[i], batch), alone)


@pytest.mark.product
@pytest.mark.parametrize("name", BATCHED)
def test_a_run_of_a_batch_fails_as_it_does_alone(name):
    filter_, (model, rows) = FILTERS[name].make(), rows_and_model()
    infinite = rows.y.y0.at[0, 7].set(jnp.inf)
    unknown = rows.u.force.at[1, 4].set(jnp.nan)
    rows = rows._replace(y=rows.y._replace(y0=infinite), u=rows.u._replace(force=unknown))
    batch = eqx.filter_vmap(lambda rows: filters.scan(filter_, model, rows, None, ()))(rows)
    alone = [filters.scan(filter_, model, jax.tree.map(lambda leaf, i=i: leaf[i], rows), None, ()) for i in (0, 1)]
    assert batch.result.tolist() == [int(one.result) for one in alone] == [Result.non_finite_input] * 2
    assert batch.failed_at.tolist() == [int(one.failed_at) for one in alone]


@pytest.mark.product
@pytest.mark.parametrize("name", SMOOTHED)
def test_a_batch_is_smoothed_as_its_runs(name):
    filter_, (model, rows) = FILTERS[name].make(), rows_and_model()
    smooth = lambda rows: rauch_tung_striebel(filter_, model, rows)
    batch = eqx.filter_vmap(smooth)(rows)
    alone = smooth(jax.tree.map(lambda leaf: leaf[1], rows))
    same(jax.tree.map(lambda leaf: leaf[1], batch), alone)


def test_the_gradient_of_a_batch_is_that_of_its_runs():
    model, rows = rows_and_model()
    leaves, rest = eqx.partition(model, eqx.is_inexact_array)
    value = lambda leaves, rows: (
        filters.scan(filters.Unscented(), eqx.combine(leaves, rest), rows, None, ()).log_likelihood
    )
    together = jax.jit(jax.grad(lambda leaves: jnp.sum(jax.vmap(value, in_axes=(None, 0))(leaves, rows))))(leaves)
    one_by_one = jax.jit(jax.vmap(jax.grad(value), in_axes=(None, 0)))(leaves, rows)
    same(together, jax.tree.map(lambda leaf: leaf.sum(axis=0), one_by_one))


def primitives(jaxpr):
    """Names of the primitives of a jaxpr and those inside, with the shapes of their results."""
    for equation in jaxpr.eqns:
        yield equation.primitive.name, [one.aval.shape for one in equation.outvars]
        for value in equation.params.values():
            for inner in value if isinstance(value, tuple | list) else [value]:
                inner = getattr(inner, "jaxpr", inner)
                if hasattr(inner, "eqns"):
                    yield from primitives(inner)


def test_a_batch_of_few_states_is_written_out_and_no_other(monkeypatch):
    model, rows = rows_and_model()

    def matrices():
        """How many batches of matrices are reckoned."""
        scan = lambda rows: filters.scan(filters.Unscented(), model, rows)
        found = primitives(jax.make_jaxpr(jax.vmap(scan))(rows).jaxpr)
        return sum(len(shape) > 2 for _, shapes in found for shape in shapes)

    # The first row is not: it is reckoned once.
    few = matrices()
    monkeypatch.setattr("jaxveh.statespace.driver.FEW", 1)
    monkeypatch.setattr("jaxveh.statespace.driver.SOME", 1)
    jax.clear_caches()
    assert few < 0.7 * matrices()


def test_a_batch_of_few_rows_is_left_whole(monkeypatch):
    model, rows = rows_and_model()
    scan = lambda rows: filters.scan(filters.Unscented(), model, rows)

    def is_whole(*runs):
        form = scan
        for _ in runs:
            form = jax.vmap(form)
        many = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf[0], (*runs, *leaf[0].shape)), rows)
        return any(name == "jaxveh_by_batch" for name, _ in primitives(jax.make_jaxpr(form)(many).jaxpr))

    monkeypatch.setattr("jaxveh.statespace.driver.WORTH", 6 * len(rows.t[0]))
    jax.clear_caches()
    assert is_whole(5) and is_whole(5, 1) and is_whole(2, 2)
    assert not is_whole(6) and not is_whole(2, 3) and not is_whole(3, 2)
    batch = jax.vmap(jax.vmap(scan))(jax.tree.map(lambda leaf: jnp.stack(3 * [leaf]), rows))
    same(jax.tree.map(lambda leaf: leaf[2, 1], batch), scan(jax.tree.map(lambda leaf: leaf[1], rows)))


SHARED = [name for name in BATCHED if who_lacks(FILTERS[name].make(), "shares_covariances") is None]


def complete_rows(rows):
    return jax.tree.map(lambda leaf: jnp.where(jnp.isnan(leaf), 0.1, leaf), rows)


FORMS = {"filtered": filters.scan, "smoothed": rauch_tung_striebel, "in parallel": parallel_smoother}


@pytest.mark.parametrize("missing", [False, True], ids=["complete", "one missing"])
@pytest.mark.parametrize("name", SHARED)
def test_runs_share_covariances_where_no_row_is_missing(name, missing):
    filter_, (model, rows) = FILTERS[name].make(), rows_and_model()
    rows = complete_rows(rows)
    if missing:
        rows = rows._replace(y=rows.y._replace(y1=rows.y.y1.at[1, 3].set(jnp.nan)))
    # In parallel over time there is the form with covariances alone.
    for form in list(FORMS.values())[: None if filter_.form.keeps_matrix else 2]:
        batch = eqx.filter_vmap(lambda rows, form=form: form(filter_, model, rows), in_axes=(eqx.if_array(0),))(rows)
        for i in range(len(rows.t)):
            same(
                jax.tree.map(lambda leaf, i=i: leaf[i], batch),
                form(filter_, model, jax.tree.map(lambda leaf, i=i: leaf[i], rows)),
            )


def kept_by(found):
    """The log-likelihood and the means, which the measurements change."""
    estimate = getattr(found, "filtered", found)
    return estimate.log_likelihood, found.mean


@pytest.mark.parametrize("form", FORMS)
def test_shared_covariances_are_reckoned_once_and_those_of_other_noises_are_not(form):
    model, rows = rows_and_model()
    rows = jax.tree.map(lambda leaf: leaf[0], complete_rows(rows))
    y = jax.tree.map(lambda leaf: jnp.stack([leaf + 0.1 * k for k in range(7)]), rows.y)

    def batched(filter_, noise):
        """Of each branch (complete, not complete), how many results have the batch's axis."""
        with_noise = lambda noise: eqx.tree_at(lambda m: m.measurement_noise.std.y0, model, noise)
        of = lambda y, noise: kept_by(FORMS[form](filter_, with_noise(noise), rows._replace(y=y)))
        program = jax.make_jaxpr(jax.vmap(of, in_axes=(0, 0 if noise.ndim else None)))(y, noise)
        (branches,) = [
            equation.params["branches"] for equation in program.jaxpr.eqns[0].params["jaxpr"].jaxpr.eqns
            if equation.primitive.name == "cond"
        ]  # fmt: skip
        return [sum(7 in shape for _, shapes in primitives(one.jaxpr) for shape in shapes) for one in branches]

    complete, other = batched(filters.Kalman(), jnp.asarray(0.5))
    assert complete < 0.4 * other
    complete, other = batched(filters.Kalman(), jnp.linspace(0.5, 0.6, 7))
    assert complete > 0.8 * other


def test_the_gradient_of_a_batch_in_parallel_is_that_of_its_runs():
    model, rows = rows_and_model()
    rows = complete_rows(rows)

    def total(noise, rows):
        found = parallel_smoother(
            filters.Kalman(), eqx.tree_at(lambda m: m.measurement_noise.std.y0, model, noise), rows
        )
        return found.filtered.log_likelihood + jnp.sum(found.mean.x0)

    noise = jnp.asarray(0.5)
    batch = jax.grad(lambda noise: jnp.sum(jax.vmap(total, in_axes=(None, 0))(noise, rows)))(noise)
    runs = [jax.grad(total)(noise, jax.tree.map(lambda leaf, i=i: leaf[i], rows)) for i in range(len(rows.t))]
    np.testing.assert_allclose(batch, sum(runs), rtol=1e-9)


@pytest.mark.parametrize(
    "keep", [(), ("mean",), ("std",), ("mean", "std"), ("info",), ("info.nis", "info.whitened", "std")]
)
def test_an_estimate_keeps_what_it_is_asked_to(keep):
    model = MODELS["linear"]()
    recording = recordings("linear")[0]
    whole, part = (
        filters.run(filters.Extended(), model, recording),
        filters.run(filters.Extended(), model, recording, keep=keep),
    )
    assert part.result == whole.result
    # On jax 0.12 the sum over the rows is another program where nothing else is kept, and may differ in the last digit.
    np.testing.assert_allclose(part.log_likelihood, whole.log_likelihood, rtol=1e-15)
    for name in ("mean", "std"):
        if name in keep:
            same(getattr(part, name), getattr(whole, name), 0.0, 0.0)
        assert (getattr(part, name) is None) == (name not in keep)
    fields = Info._fields if "info" in keep else [name.removeprefix("info.") for name in keep if "." in name]
    assert (part.info is None) == (not fields)
    for name in fields:
        same(getattr(part.info, name), getattr(whole.info, name), 0.0, 0.0)
    if part.info is not None:
        assert all(getattr(part.info, name) is None for name in set(Info._fields) - set(fields))


def test_remarks_are_told_though_nothing_is_kept():
    particles = filters.AuxiliaryParticleFilter(20)
    found = filters.run(
        particles, MODELS["linear"](), recordings("linear")[0], key=jax.random.key(0), keep=(), throw=False
    )
    assert found.info.remark.shape == (25,) and found.info.nis is None and found.mean is None


@pytest.mark.parametrize("name", ["Extended", "Unscented"])
def test_a_long_run_that_shows_nothing_is_the_one_that_shows_its_rows(name, monkeypatch):
    """Where nothing is kept it is written out alone, too; the rest of this file says that a batch is."""
    filter_, model, recording = FILTERS[name].make(), MODELS["linear"](), recordings("linear")[1]
    forms = []
    form = kit.scan_in_form
    monkeypatch.setattr("jaxveh.numerics.pays_alone", lambda: True)
    watched = lambda *given, steps, **more: forms.append(steps.value) or form(*given, steps=steps, **more)
    monkeypatch.setattr("jaxveh.statespace.driver.scan_in_form", watched)
    jax.clear_caches()
    alone = filters.run(filter_, model, recording, keep=())
    assert forms and set(forms) == {"written out"}
    shown = filters.run(filter_, model, recording)
    assert "whole" in forms
    same(alone.log_likelihood, shown.log_likelihood)
    same((alone.belief.mean, alone.belief.covariance), (shown.belief.mean, shown.belief.covariance))
    assert alone.failed_at == shown.failed_at == -1
    mean = model.prior.mean
    at = lambda shift: eqx.tree_at(lambda m: m.prior.mean, model, jax.tree.map(lambda x: x + shift, mean))
    values = lambda shift: filters.run(filter_, at(shift), recording, keep=()).log_likelihood
    step = 1e-5
    slope = jax.grad(values)(0.1)
    np.testing.assert_allclose(slope, (values(0.1 + step) - values(0.1 - step)) / (2 * step), rtol=1e-5, atol=1e-6)

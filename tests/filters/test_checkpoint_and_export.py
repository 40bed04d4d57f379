"""Stop and go on with the same bits; steps in a process that knows nothing of this package."""

import dataclasses
import functools
import json
import subprocess
import sys
import textwrap

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_systems import linear_model, linear_recording
from test_every_filter import CHANGES, GROUPS, linear, noisier, same

from jaxveh import InputError, filters
from jaxveh._core.names import record_type

MODEL = linear_model(3, 2, seed=3)
RECORDING = linear_recording(MODEL, rows=20)
ROWS = jax.tree.map(np.asarray, MODEL.rows(RECORDING))
KINDS = {
    "UKF": filters.Unscented(),
    "square root": filters.Cubature(form=filters.SquareRoot()),
    "APF": filters.AuxiliaryParticleFilter(100),
}
INDEPENDENT = linear()
OTHERS = {
    "Sage-Husa": filters.SageHusa(filters.Cubature()),
    "interacting": filters.InteractingModels(filters.Kalman(), (same, noisier), CHANGES),
    "delayed": filters.Delayed(filters.Kalman(), {"y1": 0.15}, depth=5),
    "fixed lag": filters.FixedLag(filters.Kalman(), 2),
    "marginalised": filters.Marginalised(50, ("x2",)),
    "ensemble": filters.Ensemble(50),
    "federated": filters.Federated(filters.Kalman(), GROUPS),
}


KEY = jax.random.key(4)


def kind_and_model(name):
    return (KINDS[name], MODEL) if name in KINDS else (OTHERS[name], INDEPENDENT)


def row(k):
    return jax.tree.map(lambda leaf: leaf[k], ROWS)


@eqx.filter_jit
def init(filter_, model, row, key):
    """The first belief, its log-likelihood, and the moments that it reports."""
    belief, info = filter_.init(model, row, key)
    return belief, info.log_likelihood, belief.moments(model)


@eqx.filter_jit
def step(filter_, model, belief, row):
    belief, info = filter_.step(model, belief, row)
    return belief, info.log_likelihood, belief.moments(model)


@functools.cache
def by_rows(name):
    """Beliefs, log-likelihoods and moments of all rows, one by one."""
    filter_, model = kind_and_model(name)
    found = [init(filter_, model, row(0), KEY)]
    for k in range(1, 20):
        found.append(step(filter_, model, found[-1][0], row(k)))
    return found


@pytest.mark.thorough
@pytest.mark.parametrize("name", [*KINDS, *OTHERS])
def test_a_broken_run_goes_on_bit_for_bit(name, tmp_path):
    whole = [belief for belief, *_ in by_rows(name)]
    path = filters.save_belief(tmp_path / "belief.npz", whole[9])
    again = filters.load_belief(path, whole[0])
    for k in range(10, 20):
        again, *_ = step(*kind_and_model(name), again, row(k))
    for a, b in zip(jax.tree.leaves(whole[-1]), jax.tree.leaves(again), strict=True):
        a, b = (jax.random.key_data(v) if jnp.issubdtype(v.dtype, jax.dtypes.prng_key) else v for v in (a, b))
        np.testing.assert_array_equal(a, b)


def test_a_file_of_another_filter_is_refused(tmp_path):
    belief, *_ = init(KINDS["APF"], MODEL, row(0), KEY)
    path = filters.save_belief(tmp_path / "a.npz", belief)
    fewer, *_ = init(filters.AuxiliaryParticleFilter(50), MODEL, row(0), KEY)
    with pytest.raises(InputError, match=r"particles.*\[100\], expected float64\[50\]"):
        filters.load_belief(path, fewer)
    gaussian, *_ = init(KINDS["UKF"], MODEL, row(0), KEY)
    with pytest.raises(InputError, match="it is of another filter or model"):
        filters.load_belief(path, gaussian)
    other = dataclasses.replace(gaussian, state_type=record_type("Other", ("a", "b", "c")))
    with pytest.raises(InputError, match="its states are x0, x1, x2, expected a, b, c: it is of another model"):
        filters.load_belief(filters.save_belief(tmp_path / "g.npz", gaussian), other)
    with pytest.raises(InputError, match="there is no such file"):
        filters.load_belief(tmp_path / "b.npz", gaussian)
    with pytest.raises(InputError, match=r"must end in \.npz"):
        filters.save_belief(tmp_path / "b.txt", gaussian)


LIVE = """
    import json, pathlib, sys
    import jax, jax.export, numpy as np
    jax.config.update("jax_enable_x64", True)
    data, *folders = map(pathlib.Path, sys.argv[1:])
    rows, said = np.load(data), {}
    for folder in folders:
        init, step = (
            jax.export.deserialize(bytearray((folder / f"{name}.jaxexport").read_bytes())) for name in ("init", "step")
        )
        total = 0.0
        for k, (t, u, y) in enumerate(zip(rows["t"], rows["u"], rows["y"])):
            state, mean, std, numbers = init.call(t, u, y) if k == 0 else step.call(state, t, u, y)
            total += float(numbers[0])
        said[folder.name] = [total, list(map(float, mean)), list(map(float, std))]
    assert not any(name == "jaxveh" or name.startswith("jaxveh.") for name in sys.modules)
    print(json.dumps(said))
"""
EXPORTED = ("square root", "APF", "interacting")


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """The folders of filters, and what one program without this package says with each."""
    place = tmp_path_factory.mktemp("exported")
    folders = {name: filters.export_filter(place / name, *kind_and_model(name), key=KEY) for name in EXPORTED}
    data, script = place / "rows.npz", place / "live.py"
    np.savez(data, t=ROWS.t, u=np.stack(ROWS.u, axis=1), y=np.stack(ROWS.y, axis=1))
    script.write_text(textwrap.dedent(LIVE))
    done = subprocess.run(
        [sys.executable, "-I", *map(str, (script, data, *folders.values()))],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return folders, json.loads(done.stdout)


@pytest.mark.thorough
@pytest.mark.parametrize("name", EXPORTED)
def test_an_exported_filter_runs_without_this_package(name, exported):
    folder = exported[0][name]
    described = json.loads((folder / "names.json").read_text())
    assert described["inputs"] == ["force"] and described["channels"] == ["y0", "y1"]
    assert described["report"] == ["x0", "x1", "x2"]
    total, mean, std = exported[1][name]
    _, logs, moments = zip(*by_rows(name), strict=True)
    np.testing.assert_allclose(total, np.sum(logs), rtol=1e-12)
    np.testing.assert_allclose(mean, moments[-1][0], rtol=1e-10)
    np.testing.assert_allclose(std, moments[-1][1], rtol=1e-10)
    with pytest.raises(InputError, match="exists already"):
        filters.export_filter(folder, *kind_and_model(name), key=KEY)

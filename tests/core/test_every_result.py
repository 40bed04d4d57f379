"""Every result, car and tyre of the package: how it looks, what it becomes, and that it comes back as it was."""

import dataclasses
import html.parser
import inspect
import random
import subprocess
import sys
import textwrap
from types import ModuleType

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mutations import spoil

import jaxveh
from jaxveh import (
    InputError,
    Parameters,
    Recording,
    estimators,
    filters,
    fitting,
    io,
    kit,
    statespace,
    sweeps,
    tyres,
    vehicles,
)  # fmt: skip
from jaxveh._core.estimated import Estimated
from jaxveh._core.names import as_mapping
from jaxveh._core.parameter import resolve
from jaxveh._core.shown import Kept, Shown

pandas, xarray = pytest.importorskip("pandas"), pytest.importorskip("xarray")
pytest.importorskip("h5netcdf")
figures = pytest.importorskip("matplotlib.figure")

ODD = "<b>&'\"µ x/y [1]"
"""Words that a page, a file or a name may stumble over."""

NO_RESULT = {
    "Accuracy": "numbers of a study over many runs, a NamedTuple of arrays",
    "PosteriorBound": "a bound of theory, a NamedTuple of arrays",
    "Runs": "of a study over many runs, a NamedTuple of arrays",
    "InnovationPoints": "what a figure draws",
    "Piece": "rows of a pass forward and back, a NamedTuple of arrays",
    "LaggedLoads": "its time is a time constant",
    "Channel": "its time is the name of a column",
    "ChannelMap": "its time is the name of a column",
    "ChangingSpeed": "a manoeuvre",
    "Replay": "a manoeuvre",
}
OWN_FILES = {
    "Calibration": "a file that one can read: write_calibration",
    "CarSpecification": "a car's file: write_car",
    "vehicle": "is made of a car's file",
    "tyre": "tyres.write_parameters, io.write_property_file",
}
"""What is shown but keeps itself otherwise, or not at all."""
FAMILIES = {"vehicle": vehicles.AbstractVehicle, "tyre": tyres.AbstractTyre, "fit": fitting.AbstractFit}
BY_NAME = {"Calibration", "CarSpecification", "Parameters", "RigTable", "Swept"}


def classes():
    """The public classes of every room, and of rooms in rooms, by name."""
    rooms = [
        jaxveh,
        *(getattr(jaxveh, name) for name in jaxveh.__all__ if isinstance(getattr(jaxveh, name), ModuleType)),
    ]
    inner = [one for room in rooms[1:] for one in map(room.__dict__.get, room.__all__) if isinstance(one, ModuleType)]
    found = {}
    for room in (*rooms, *inner):
        for name in getattr(room, "__all__", ()):
            one = getattr(room, name)
            if inspect.isclass(one):
                found[name] = one
    return found


def fields_of(one):
    return (
        [f.name for f in dataclasses.fields(one)]
        if dataclasses.is_dataclass(one)
        else list(getattr(one, "_fields", ()))
    )


RESULTS = {
    name: one
    for name, one in classes().items()
    if "time" in fields_of(one) or name in BY_NAME or issubclass(one, tuple(FAMILIES.values()))
}


def family(one):
    return next((name for name, base in FAMILIES.items() if issubclass(one, base)), one.__name__)


def test_there_are_some():
    assert len(RESULTS) > 50 and {"Recording", "Estimate", "Answers", "RigFit", "Swept", "FourteenDOF"} <= set(RESULTS)
    assert set(NO_RESULT) <= set(RESULTS)


@pytest.mark.parametrize("name", [name for name in RESULTS if name not in NO_RESULT])
def test_every_result_is_shown_and_kept(name):
    one = RESULTS[name]
    assert issubclass(one, Shown), f"{name}: a result is shown (_core/shown.py), or stands in NO_RESULT with a reason"
    of_class = OWN_FILES.keys() & {family(one)}
    assert issubclass(one, Kept) != bool(of_class), f"{name}: is kept (Kept), or stands in OWN_FILES with a reason"
    # `Shown` stands first among the bases: equinox has a repr of its own.
    assert one.__repr__ is Shown.__repr__ and one._labelled is not Shown._labelled
    assert one.plot is not Shown.plot or one.drawn_by in jaxveh.plots.__all__
    assert not [f for f in fields_of(one) if f in ("drawn_by", "by_row", "by_run", "records", "called", "kept_fields")]


class System(eqx.Module):
    """A sensor's scale."""

    k: jax.Array = kit.positive("-", default=1.0)


State, Measured = kit.record_type("State", ("x1", "v_x")), kit.record_type("Measured", ("y",))
MODEL = statespace.StateSpace(
    transition=lambda system, t0, t1, x, u: x,
    observation=lambda system, t, x, u: Measured(system.k * x.x1),
    process_noise=statespace.Continuous(statespace.Gaussian({"x1": 1.0, "v_x": 1.0})),
    measurement_noise=statespace.Gaussian({"y": 1.0}),
    prior=statespace.Prior(State(0.0, 0.0), {"x1": 1.0, "v_x": 1.0}),
    system=System(),
)
SCALE = lambda model: (model.system.k,)
T = np.arange(8) * 0.1
NOISE = lambda model: (model.measurement_noise.std.y,)


def recording():
    channels = {"v_x": np.r_[T[:-1], np.nan], ODD: jnp.asarray(T, jnp.float32), "true.v_y": -T}
    return Recording(T, channels, {"v_x": "m/s", ODD: ODD}, ODD)


def measured():
    return Recording(T, {"y": np.where(T[3] == T, np.nan, np.sin(T))})


def estimate():
    return jaxveh.run(filters.Unscented(), statespace.with_parameters(MODEL, SCALE, 0.1), measured())


def answers():
    fields = dict(
        mean=State(T, -T), std=State(T + 1, T * np.nan), known=State(T > 0.2, T > 0.3), result=np.zeros(8, np.int32)
    )
    return estimators.Answers(T, *jax.tree.map(jnp.asarray, tuple(fields.values())))


def smoothed():
    found = estimate()
    draws = State(jnp.ones((8, 3)), jnp.zeros((8, 3)))
    return filters.SmoothedEstimate(
        T, found.mean, found.std, found.parameters, found.parameters_std, found, draws, jnp.full(3, 1 / 3)
    )


def fit():
    chosen, number = resolve(MODEL, NOISE), jnp.asarray(0.25)
    named = Parameters({chosen[0].name: number})
    return fitting.Fit(
        named, named, number[None], number[None, None], number, jnp.asarray(3), jnp.asarray(0), MODEL, chosen
    )


def rig_fit():
    law = tyres.Brush(8e4, 6e4, 0.9)
    chosen = resolve(law, lambda tyre: (tyre.slip_stiffness, tyre.friction))
    two = Parameters({p.name: jnp.asarray(k + 1.0) for k, p in enumerate(chosen)})
    by = {"F_x": 0.5, "F_y": float("nan")}
    stage = fitting.StageReport("joint", 8, 2, 0.1, 1 / 3, 4, True)
    return fitting.RigFit(
        two, two, np.ones(2), np.eye(2), np.float64(0.1), np.int64(4), np.int32(0), law, chosen, 2, by, by, by, by, by,
        {"F_x": T, "F_y": -T}, (stage,), None,
    )  # fmt: skip


def calibration():
    return estimators.Calibration("sideslip", fit(), (estimators.Span(0.0, 1.0, ODD),))


def swept():
    run = lambda point, key: {
        "rmse": point.noise * jax.random.normal(key, ()),
        "path": jnp.arange(3),
        "front": {"B": 1.5},
    }
    samples = sweeps.latin_hypercube(4, mass=(1.0, 2.0))
    design = sweeps.Design(noise=[0.1, 0.2], kind={ODD: 1, "b": 2}, of=samples)
    return sweeps.sweep(run, design, 5, jax.random.key(0), note=ODD, units={"rmse": "m", "noise": ODD})


def car_file():
    return io.CarSpecification(1400.0, 2000.0, 1.0, 1.6, 9e4, 1e5, name=ODD, sensor_position=(0.1, 0.0, 0.3))


def rig_table():
    return io.RigTable(
        T - 0.3,
        0 * T,
        np.full(8, 4e3),
        F_y=np.where(np.arange(8) == 2, np.nan, 5e4 * T),
        run=np.arange(8.0) // 4,
        source=ODD,
    )


def parameters():
    return Parameters({"front.B": jnp.asarray(8.0), "rear.B": jnp.asarray(9.0), ODD: jnp.asarray(1.0)})


MADE = {
    "Recording": recording, "Estimate": estimate, "Answers": answers, "SmoothedEstimate": smoothed, "Fit": fit, "RigFit": rig_fit,
    "Parameters": parameters, "Swept": swept, "Calibration": calibration, "CarSpecification": car_file, "RigTable": rig_table,
}  # fmt: skip
CARS = {name: (lambda name=name: vehicles.named_car("sedan", name)) for name in vehicles.kit.FIDELITIES}
CARS["kinematic-trailer"] = lambda: vehicles.KinematicTrailer(3.6, 8.1)
TYRES = {
    "MF-Tyre": lambda: tyres.typical_mf_tyre(4000.0),
    "Magic Formula": lambda: tyres.MagicFormula(10.0, 1.3, 4000.0, 0.1),
    "with states": lambda: tyres.Relaxed(tyres.Brush(8e4, 6e4, 0.9), 0.3, 0.4),
}
BATCHES = {
    "Recording, a batch": lambda: jax.vmap(lambda s: recording().replace(v_x=s * T))(jnp.arange(3.0)),
    "Recording, other instants": lambda: jax.vmap(lambda s: eqx.tree_at(lambda r: r.time, recording(), T + s))(
        jnp.arange(3.0)
    ),
    "Estimate, a batch": lambda: jax.vmap(
        lambda s: jaxveh.run(filters.Unscented(), MODEL, measured().replace(y=s * T))
    )(jnp.arange(3.0)),
    "Estimate, little kept": lambda: jaxveh.run(filters.Unscented(), MODEL, measured(), keep=("mean", "info.nis")),
    "Estimate, nothing kept": lambda: jaxveh.run(filters.Unscented(), MODEL, measured(), keep=()),
    "Answers, a batch": lambda: jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), answers()),
    "Fit, a batch": lambda: jax.tree.map(lambda leaf: jnp.stack([jnp.asarray(leaf)] * 2), fit()),
    "Parameters, along a log": lambda: Parameters({"a": jnp.asarray(T), "b": jnp.asarray(-T)}),
    "Parameters, of many kinds": lambda: Parameters(
        {"a": 1, "b": 2.5, "value": T, "d": np.float32(3), "e": jnp.asarray(True)}
    ),
    "Parameters, plain": lambda: Parameters({"a": 1.0, "b": 2.5}),
    "Swept, no axis": lambda: sweeps.sweep(lambda point, key: {"a": 1.0}, sweeps.Design(), 3, jax.random.key(0)),
}
ALL = {**MADE, **BATCHES, **CARS, **TYRES}
THOSE_KEPT = [name for name in {**MADE, **BATCHES} if name not in OWN_FILES]


@pytest.fixture(scope="module")
def made():
    """Each of them, made once."""
    cache = {}

    def make(name):
        if name not in cache:
            cache[name] = ALL[name]()
        return cache[name]

    return make


def test_one_of_each_is_made():
    concrete = {n for n, one in RESULTS.items() if n not in NO_RESULT and family(one) not in FAMILIES}
    assert concrete | {"Fit", "RigFit"} == set(MADE)


class Page(html.parser.HTMLParser):
    """What tags a page has, and its words."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.words, self.attributes = [], [], [], []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)
        self.tags.append(tag)
        self.attributes += attrs

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


ESTIMATES = [name for name in ALL if name.partition(",")[0] in ("Recording", "Estimate", "Answers", "SmoothedEstimate")]


def test_there_is_one_of_each_estimate():
    assert {name for name, one in RESULTS.items() if issubclass(one, Estimated)} <= {*ESTIMATES, *NO_RESULT}


@pytest.mark.parametrize("name", ESTIMATES)
def test_a_quantity_is_found_by_its_name_only(made, name):
    """Names of a tuple's methods (`count`, `index`) and of its private parts are none."""
    one = made(name)
    kept = one.mean if hasattr(one, "mean") else one.channels
    for quantity in () if kept is None else as_mapping(kept):
        np.testing.assert_array_equal(one[quantity], as_mapping(kept)[quantity])
    for wrong in ("count", "index", "_fields", "nothing", 0, -1, slice(1), None, ["y"], T):
        with pytest.raises(InputError, match="unknown name|was not kept|no quantity|names = |mean"):
            one[wrong]


PAGE = {"div", "p", "b", "table", "thead", "tbody", "tr", "th", "td", "details", "summary", "svg", "path"}


@pytest.mark.parametrize("name", ALL)
def test_it_looks_well_in_a_terminal(made, name):
    text = repr(made(name))
    lines = text.splitlines()
    assert lines[0].startswith(type(made(name)).__name__) and 1 <= len(lines) <= 20 and max(map(len, lines)) <= 100
    assert "cannot be shown" not in text


@pytest.mark.product
@pytest.mark.parametrize("name", ALL)
def test_it_looks_well_in_a_notebook(made, name):
    page = Page(made(name)._repr_html_())
    assert set(page.tags) <= PAGE and not [
        value for _, value in page.attributes if ":" in value and "align" not in value
    ]
    assert page.words[0].startswith(type(made(name)).__name__)


def test_words_are_escaped_and_curves_drawn():
    page = Page(recording()._repr_html_())
    assert page.words.count(ODD) == 2 and page.tags.count("b") == 1 and page.tags.count("svg") == 3


@pytest.mark.product
@pytest.mark.parametrize("name", ALL)
def test_it_looks_well_where_it_is_traced(made, name):
    texts = []
    arrays, rest = eqx.partition(made(name), eqx.is_array)

    def show(arrays):
        one = eqx.combine(arrays, rest)
        texts.append(repr(one))
        Page(one._repr_html_())
        return jax.tree.leaves(arrays)

    jax.eval_shape(show, arrays)
    assert "cannot be shown" not in texts[0] and len(texts[0].splitlines()) <= 20


def test_what_cannot_be_shown_raises_nothing():
    broken = eqx.tree_at(lambda e: e.mean, estimate(), 1)
    assert repr(broken) == "Estimate that cannot be shown: InputError"
    assert Page(broken._repr_html_()).words == [repr(broken)]


@pytest.mark.product
@pytest.mark.parametrize(
    "name", [name for name in ALL if name not in ("Swept", "Swept, no axis", "CarSpecification", "RigTable")]
)
def test_it_is_the_same_tree_as_ever(made, name):
    one = made(name)
    leaves, structure = jax.tree.flatten(one)
    again = jax.tree.unflatten(structure, leaves)
    # A dict's leaves are in the order of the alphabet.
    assert jax.tree.structure(again) == structure and sorted(repr(again).splitlines()) == sorted(repr(one).splitlines())
    arrays, _ = eqx.partition(one, eqx.is_array)
    assert jax.tree.structure(jax.jit(lambda one: one)(arrays)) == jax.tree.structure(arrays)


@pytest.mark.parametrize("name", [name for name in ALL if name != "Estimate, nothing kept"])
def test_it_is_a_data_frame(made, name):
    one = made(name)
    frame = one.to_pandas()
    assert isinstance(frame, pandas.DataFrame) and len(frame) and not frame.columns.duplicated().any()
    if name in ("Recording", "Estimate"):
        pandas.testing.assert_frame_equal(frame, io.to_frame(one))
    if "parameter" in frame.columns and name in (*CARS, *TYRES):
        assert {"value", "unit"} <= set(frame.columns)


@pytest.mark.product
@pytest.mark.parametrize("name", ALL)
def test_it_is_a_dataset(made, name):
    data = made(name).to_xarray()
    assert isinstance(data, xarray.Dataset) and data.attrs["kind"] in {type(made(name)).__name__, "Fit"}
    assert len(data.data_vars) and all(isinstance(one.attrs.get("units", ""), str) for one in data.variables.values())


def as_kept(one):
    """What is left of it in a file: no belief, no problem, of a model its numbers by their places."""
    if isinstance(one, statespace.Estimate):
        return dataclasses.replace(one, belief=None)
    if isinstance(one, filters.SmoothedEstimate):
        return dataclasses.replace(one, filtered=as_kept(one.filtered))
    if isinstance(one, fitting.AbstractFit):
        leaves = jax.tree_util.tree_flatten_with_path(one.model)[0]
        numbers = {jax.tree_util.keystr(path): leaf for path, leaf in leaves}
        return one if isinstance(one.model, dict) else dataclasses.replace(one, model=numbers)
    if isinstance(one, io.RigTable):
        return dataclasses.asdict(one)
    if isinstance(one, sweeps.Swept):
        plain = lambda axis: axis._replace(values=axis.labels)
        return [{**dataclasses.asdict(one), "design": [plain(axis)._asdict() for axis in one.design.axes]}]
    return one


def same(first, second):
    """Equal in every bit, type and place; NaN where NaN is."""
    first, second = as_kept(first), as_kept(second)
    assert jax.tree.structure(first) == jax.tree.structure(second)
    for one, other in zip(jax.tree.leaves(first), jax.tree.leaves(second), strict=True):
        assert type(one) is type(other) or {type(one), type(other)} <= {np.ndarray, np.float64}, (one, other)
        if not isinstance(one, str):
            assert (
                np.asarray(one).dtype == np.asarray(other).dtype
                and np.asarray(one).tobytes() == np.asarray(other).tobytes()
            )
    return True


@pytest.mark.product
@pytest.mark.parametrize("name", THOSE_KEPT)
def test_it_comes_back_from_xarray(made, name):
    one = made(name)
    assert same(type(one).from_xarray(one.to_xarray()), one)


@pytest.mark.product
@pytest.mark.parametrize("suffix", io.kit.RESULT_SUFFIXES)
@pytest.mark.parametrize("name", THOSE_KEPT)
def test_it_comes_back_from_a_file(made, name, suffix, tmp_path):
    one, path = made(name), tmp_path / f"kept{suffix}"
    if name == "Estimate, nothing kept" and suffix == ".parquet":
        pytest.skip("its rows are its instants alone")
    one.save(path)
    again = type(one).load(path)
    assert same(again, one) and repr(again) == repr(one)
    with pytest.raises(InputError, match="exists already; pass overwrite=True"):
        one.save(path)
    one.save(path, overwrite=True)
    again.save(path, overwrite=True)
    assert same(type(one).load(path), one)


@pytest.mark.product
@pytest.mark.parametrize("name", THOSE_KEPT)
def test_what_is_wrong_is_told(made, name, tmp_path):
    one = made(name)
    with pytest.raises(InputError, match=r"suffix '\.parket'; .* must end in one of .*Did you mean \.parquet\?"):
        one.save(tmp_path / "kept.parket")
    with pytest.raises(InputError, match=r"suffix '\.ncc'; .* must end in one of .*Did you mean \.nc\?"):
        type(one).load(tmp_path / "kept.ncc")
    other = made("Fit" if type(one) is not fitting.Fit else "Answers")
    other.save(tmp_path / "other.nc")
    with pytest.raises(
        InputError, match=f"other.nc: must be of {type(one).__name__}, but is of {type(other).__name__}"
    ):
        type(one).load(tmp_path / "other.nc")
    with pytest.raises(InputError, match=f"{type(one).__name__}.from_xarray: list: must be an xarray.Dataset"):
        type(one).from_xarray([])
    data = other.to_xarray()
    del data.attrs["jaxveh"]
    with pytest.raises(InputError, match=r"from another program|no coordinate `time`"):
        type(one).from_xarray(data)


DRAWN = {
    "Parameters": {"truth": {"front.B": 8.5, "rear.B": 8.0, ODD: 1.0}},
    "Estimate": {"truth": {"x1": np.sin(T), "v_x": T}},
    "Fit": {"truth": {"measurement_noise.std.y": 0.3}},
}
NOT_DRAWN = {
    "Estimate, nothing kept": "has no mean", "Estimate, little kept": "has no std", "longitudinal": "has no wheels",
    "Swept": "has values of several kinds: a name is given below", "Swept, no axis": "is one number",
}  # fmt: skip


@pytest.mark.product
@pytest.mark.parametrize("name", [name for name in {**MADE, **CARS, **TYRES} if name not in NOT_DRAWN])
def test_it_is_a_figure(made, name):
    assert isinstance(made(name).plot(**DRAWN.get(name, {})), figures.Figure)


def test_a_value_of_a_sweep_is_a_figure(made):
    assert isinstance(made("Swept").plot("rmse"), figures.Figure)


def test_what_cannot_be_drawn_is_told(made):
    with pytest.raises(InputError, match=r"Longitudinal has no wheel positions"):
        vehicles.Longitudinal(1500.0).plot()
    with pytest.raises(InputError, match=r"a batch of cars"):
        jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), vehicles.passenger_car()).plot()
    with pytest.raises(InputError, match="must be 1 to 40, of one number each"):
        made("Fit, a batch").plot()
    with pytest.raises(InputError, match="Estimate: std was not kept"):
        made("Estimate, little kept").plot()
    with pytest.raises(InputError, match="Estimate: mean, std was not kept"):
        made("Estimate, nothing kept").plot()
    with pytest.raises(InputError, match="Estimate: mean was not kept"):
        made("Estimate, nothing kept").to_pandas()


def test_a_fit_gets_its_model_back(made, tmp_path):
    one = fit()
    one = dataclasses.replace(one, model=eqx.tree_at(NOISE, MODEL, (jnp.asarray(0.125),)))
    one.save(tmp_path / "fit.nc")
    again = fitting.Fit.load(tmp_path / "fit.nc").with_model(MODEL)
    assert jax.tree.structure(again) == jax.tree.structure(one) and again.model.measurement_noise.std.y == 0.125
    assert again.chosen == one.chosen
    with pytest.raises(InputError, match="with_model: .* differ between the fitted model and this one"):
        again.with_model(tyres.Brush(8e4, 6e4, 0.9))


def test_a_rig_fit_with_its_rig_is_drawn_as_one(monkeypatch):
    monkeypatch.setattr(jaxveh.plots, "rig_fit", lambda fit, rig, **options: (fit, rig, options))
    one = rig_fit()
    assert one.plot("a rig", channels=["F_x"]) == (one, "a rig", {"channels": ["F_x"]})


def test_a_sweep_is_what_xarray_opens_of_its_store(tmp_path):
    pytest.importorskip("zarr")
    pytest.importorskip("filelock")
    run = lambda point, key: {"rmse": point.noise * jax.random.normal(key, ()), "path": jnp.arange(3)}
    design = sweeps.Design(noise=[0.1, 0.2], kind={"a": 1, "b": 2})
    told = dict(units={"rmse": "m", "noise": "rad"}, note="a note")
    found = sweeps.sweep(run, design, 5, jax.random.key(0), store=tmp_path / "kept.zarr", **told)
    mine, theirs = found.to_xarray(), xarray.open_zarr(tmp_path / "kept.zarr")
    for name in mine.variables:
        assert mine[name].dims == theirs[name].dims and mine[name].attrs.get("units") == theirs[name].attrs.get("units")
        np.testing.assert_array_equal(mine[name].values, theirs[name].values)
    again = sweeps.Swept.load(tmp_path / "kept.zarr")
    assert again.to_xarray().equals(mine) and "rmse" in repr(again)


def test_what_was_given_a_file_of_its_own_comes_back(tmp_path):
    car_file().save(tmp_path / "car.toml")
    assert io.CarSpecification.load(tmp_path / "car.toml") == car_file()
    with pytest.raises(InputError, match="did not start from a car's file"):
        calibration().save(tmp_path / "calibration.toml")


COUNT = 30
"""Spoilt files of each kind."""


@pytest.mark.parametrize("suffix", io.kit.RESULT_SUFFIXES)
@pytest.mark.parametrize("name", ["Estimate", "RigFit", "Swept"])
def test_a_spoilt_file_is_a_result_or_an_error(made, name, suffix, tmp_path):
    path, kind = tmp_path / f"odd{suffix}", type(made(name))
    made(name).save(path)
    whole, refused = path.read_bytes(), 0
    for k in range(COUNT):
        path.write_bytes(spoil(random.Random(f"{name}/{k}"), whole))
        try:
            found = kind.load(path)
        except InputError as error:
            refused += str(path) in str(error)
            continue
        assert type(found) is kind and "cannot be shown" not in repr(found)
    assert refused > COUNT / 4


MISSING = {
    "xarray": lambda one, path: one.to_xarray(),
    "pandas": lambda one, path: one.to_pandas(),
    "pyarrow": lambda one, path: one.save(path.with_suffix(".parquet")),
    "h5netcdf": lambda one, path: one.save(path.with_suffix(".nc")),
}


@pytest.mark.parametrize("library", MISSING)
def test_a_missing_library_is_named(made, library, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(InputError, match=rf'{library} is not installed, and .* run `pip install "jaxveh\[io\]"`'):
        MISSING[library](made("Answers"), tmp_path / "kept")
    assert repr(made("Answers")) and not list(tmp_path.iterdir())


def test_nothing_is_imported_before_it_is_asked_for():
    """Neither an upper room nor an optional library by what is looked at alone."""
    code = """
        import sys
        import jaxveh
        found = jaxveh.Recording([0.0, 1.0], {"v_x": [1.0, 2.0]})
        assert repr(found) and found._repr_html_()
        print(*(name for name in ("jaxveh.plots", "pandas", "xarray", "matplotlib", "h5py", "pyarrow") if name in sys.modules))
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""

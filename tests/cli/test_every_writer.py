"""All that writes files writes whole ones, or nothing: on a full disk, on Ctrl-C, after a kill."""

import ast
import contextlib
import json
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import equinox as eqx
import jax
import numpy as np
import pandas as pd
import pytest
from programs import run

import jaxveh
from jaxveh import InputError, Parameters, Recording, estimators, filters, fitting, io, plots, statespace, tyres
from jaxveh._core.names import record_type
from jaxveh._core.parameter import resolve
from jaxveh.cli import all_papers, estimate_report, output
from jaxveh.cli.drives import Drive
from jaxveh.estimators import geometry
from jaxveh.estimators.geometry import learned
from jaxveh.experiments.sideslip_review import network_training
from jaxveh.io import files

resource = pytest.importorskip("resource")  # the size of files can be limited

ROOT = Path(jaxveh.__file__).parent
ROWS = 2000
RECORDING = Recording(np.arange(ROWS) * 0.01, {"yaw_rate": np.sin(np.arange(ROWS))}, {"yaw_rate": "rad/s"}, "made up")


State, Measured = record_type("State", ("x1", "x2")), record_type("Measured", ("y",))
WAVES = State(*np.random.default_rng(0).normal(size=(2, ROWS)))
ANSWERS = estimators.Answers(np.arange(ROWS) * 0.01, WAVES, WAVES, WAVES, WAVES.x1)
MODEL = statespace.StateSpace(
    transition=lambda system, t0, t1, x, u: x,
    observation=lambda system, t, x, u: Measured(x.x1),
    process_noise=statespace.Continuous(statespace.Gaussian({"x1": 1.0, "x2": 1.0})),
    measurement_noise=statespace.Gaussian({"y": 1.0}),
    prior=statespace.Prior(State(0.0, 0.0), {"x1": 1.0, "x2": 1.0}),
)


@pytest.fixture(scope="module")
def belief():
    row = MODEL.rows(Recording(np.arange(2.0), {"y": np.zeros(2)}))
    return filters.AuxiliaryParticleFilter(500).init(MODEL, jax.tree.map(lambda leaf: leaf[0], row), jax.random.key(0))[
        0
    ]


def every_paper(path, monkeypatch):
    monkeypatch.setattr(all_papers, "run_program", lambda *rest: all_papers.Done(0, "", {"x": [1.5] * 100}, 1.0))
    all_papers.all_papers({"tyre-apf": {}}, path)


def report(path):
    waves = {"sideslip": RECORDING["yaw_rate"], "v_y": RECORDING["yaw_rate"]}
    log = plots.ReportedLog("a log", SimpleNamespace(time=RECORDING.time, mean=waves, std=waves), RECORDING)
    drive = Drive(Path("drive.csv"), RECORDING)
    estimate_report.write_report(path, [log], [drive], CAR, None, "in words", {}, overwrite=True)


def calibration(path):
    """Of one parameter, that nobody has fitted."""
    model, number = estimators.sideslip.model(CAR), jax.numpy.zeros(())
    chosen = resolve(model, lambda model: (model.system.stiffness,))
    named = Parameters({chosen[0].name: model.system.stiffness})
    fit = fitting.Fit(
        parameters=named, parameters_std=named, unconstrained=number[None], covariance=number[None, None], cost=number,
        steps=jax.numpy.zeros((), int), result=jax.numpy.zeros((), int), model=model, chosen=chosen,
    )  # fmt: skip
    spans, told = (estimators.Span(0.0, 1.0, "log " * 500),), estimators.kit.start_of(CAR)
    estimators.write_calibration(estimators.Calibration("sideslip", fit, spans, told=told), path, overwrite=True)


CAR = io.CarSpecification(1400.0, 2000.0, 1.0, 1.6, 9e4, 1e5, name="a car" * 50)
SLOPE = io.RoadSpecification((0.0, 1.0, 2.0), (1.0, 1.0, 0.5), name="a road" * 50)
OVER = {"overwrite": True}
WRITERS = {
    "write_recording csv": lambda path: io.write_recording(RECORDING, path, **OVER),
    "write_recording parquet": lambda path: io.write_recording(RECORDING, path, **OVER),
    "write_recording mf4": lambda path: io.write_recording(RECORDING, path, **OVER),
    "write_recording nc": lambda path: io.write_recording(RECORDING, path, **OVER),
    "save_result nc": lambda path: ANSWERS.save(path, **OVER),
    "save_result parquet": lambda path: ANSWERS.save(path, **OVER),
    "write_frame csv": lambda path: io.write_frame(io.to_frame(RECORDING), path, **OVER),
    "write_topics mcap": lambda path: io.write_topics({"/log": io.to_frame(RECORDING)}, path, **OVER),
    "write_car toml": lambda path: io.write_car(CAR, path, **OVER),
    "write_road toml": lambda path: io.write_road(SLOPE, path, **OVER),
    "write_property_file tir": lambda path: io.write_property_file(
        tyres.to_property_file(tyres.typical_mf_tyre(4000.0)), path, **OVER
    ),
    "write_parameters toml": lambda path: tyres.write_parameters(
        tyres.MagicFormula(B=10.0, C=1.3, D=4000.0, E=0.1), path, note="long " * 100, **OVER
    ),
    "write_text txt": lambda path: io.write_text("line\n" * 1000, path, **OVER),
    "write_report html": report,
    "write_calibration toml": calibration,
    "write_learned toml": lambda path: geometry.write_learned(
        geometry.Learned({name: learned.Entry(1.0, 0.1, True) for name in geometry.SHOWN}), path, **OVER
    ),
    "write_weights npz": lambda path: network_training.write_weights(
        path, eqx.nn.MLP(25, 2, 32, 2, key=jax.random.key(0)), **OVER
    ),
    "save png": lambda path: plots.save(plots.recording(RECORDING), path),
    "write_numbers json": lambda path: output.write_numbers(path, {"x": [0.5] * 1000}, {}, 0),
}
OTHERS = {"save_belief npz", "evaluate_table csv", "all_papers json"}
"""Which need fixtures."""


@pytest.fixture(params=[*WRITERS, *sorted(OTHERS)])
def writer(request, tmp_path, monkeypatch):
    """A function that writes a file to a path, and the path's suffix."""
    name, _, suffix = request.param.partition(" ")
    if suffix == "nc":
        pytest.importorskip("h5netcdf")
    if name == "save_belief":
        belief = request.getfixturevalue("belief")
        return (lambda path: filters.save_belief(path, belief)), suffix
    if name == "evaluate_table":
        folder = tmp_path / "inputs"
        folder.mkdir()
        return (lambda path: evaluate(path, folder)), suffix
    if name == "all_papers":
        return (lambda path: every_paper(path, monkeypatch)), suffix
    return WRITERS[request.param], suffix


def evaluate(path, folder):
    """The program, whose exit codes are errors again."""
    io.write_property_file(tyres.to_property_file(tyres.typical_mf_tyre(4000.0)), folder / "tyre.tir", overwrite=True)
    (folder / "inputs.csv").write_text("in_Fz,in_alpha\n" + "4000,0.1\n" * 200)
    result = run("tyre", "evaluate", folder / "tyre.tir", folder / "inputs.csv", "-o", path, "--force")
    if result.exit_code == 130:
        raise KeyboardInterrupt
    if result.exit_code == 2:
        raise InputError(result.stderr)
    assert result.exit_code == 0, result.output


@contextlib.contextmanager
def full_at(size):
    """The system refuses to make a file larger than this, as a full disk would."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    usual = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, usual)


def beside(path):
    return sorted(other.name for other in path.parent.iterdir())


def test_a_full_disk_leaves_what_was_there(writer, tmp_path, monkeypatch):
    write, suffix = writer
    path = tmp_path / "out" / f"file.{suffix}"
    path.parent.mkdir()
    write(path)
    before, size = path.read_bytes(), path.stat().st_size
    with monkeypatch.context() as patch:
        # The program's own inputs are written before the disk is full.
        full, real = [], files._beside

        @contextlib.contextmanager
        def narrow(target):
            with real(target) as part:
                if target != path:
                    yield part
                    return
                with full_at(size // 2):
                    full.append(target)
                    yield part

        patch.setattr(files, "_beside", narrow)
        with pytest.raises(InputError, match=f"file.{suffix}: cannot be written"):
            write(path)
    assert full and path.read_bytes() == before and beside(path) == [path.name]


def test_an_interrupt_leaves_what_was_there(writer, tmp_path, monkeypatch):
    write, suffix = writer
    path = tmp_path / "out" / f"file.{suffix}"
    path.parent.mkdir()
    write(path)
    before = path.read_bytes()
    real = files._settle

    def settle(part):
        if part.name == path.name:
            raise KeyboardInterrupt
        real(part)

    monkeypatch.setattr(files, "_settle", settle)
    with pytest.raises(KeyboardInterrupt):
        write(path)
    assert path.read_bytes() == before and beside(path) == [path.name]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_folder_is_whole_or_not_there(tmp_path, monkeypatch, error):
    pytest.importorskip("flatbuffers")
    real = Path.write_text

    def write_text(self, *rest, **more):
        if self.name == "names.json":
            raise error
        return real(self, *rest, **more)

    monkeypatch.setattr(Path, "write_text", write_text)
    with pytest.raises(InputError if isinstance(error, OSError) else KeyboardInterrupt):
        filters.export_filter(tmp_path / "steps", filters.Unscented(), MODEL)
    assert not list(tmp_path.iterdir())


def test_an_interrupt_that_a_library_swallows_is_raised(tmp_path):
    path = tmp_path / "file.txt"
    path.write_text("old")

    def write():
        with io.replacing_file(path, overwrite=True) as part:
            part.write_text("half")
            with contextlib.suppress(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        write()
    assert path.read_text() == "old" and beside(path) == ["file.txt"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_while_a_table_is_written(tmp_path):
    """While pandas is in its own writer, which loses interrupts."""
    frame = pd.DataFrame({"time": np.arange(200_000) * 0.01, "x": np.random.default_rng(0).normal(size=200_000)})
    path = tmp_path / "table.csv"

    def interrupt():
        while not any(file.stat().st_size for file in tmp_path.glob(".writing-*/table.csv")):
            time.sleep(1e-3)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt, daemon=True).start()
    with pytest.raises(KeyboardInterrupt):
        io.write_frame(frame, path)
    assert not list(tmp_path.iterdir())


def test_an_interrupt_is_exit_code_130(tmp_path, monkeypatch):
    def settle(part):
        raise KeyboardInterrupt

    monkeypatch.setattr(files, "_settle", settle)
    monkeypatch.setattr(all_papers, "run_program", lambda *rest: all_papers.Done(0, "", {}, 1.0))
    result = run("reproduce", "all", "--json", tmp_path / "numbers.json")
    assert result.exit_code == 130 and not list(tmp_path.iterdir())


def test_what_a_killed_program_left_goes_with_the_next_writing(tmp_path):
    source = f"""
        import os, signal
        from jaxveh.io import files
        with files.replacing_file({str(tmp_path / "file.txt")!r}) as part:
            part.write_text("half")
            os.kill(os.getpid(), signal.SIGKILL)
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(source)], check=False)
    assert done.returncode == -signal.SIGKILL and len(list(tmp_path.glob(".writing-*"))) == 1
    io.write_text("of another name", tmp_path / "other.txt")
    assert len(list(tmp_path.glob(".writing-*"))) == 1
    with io.replacing_file(tmp_path / "file.txt") as part:  # one that lives, beside it
        io.write_text("whole", tmp_path / "file.txt")
        assert len(list(tmp_path.glob(".writing-*"))) == 1
        part.write_text("later")
    assert beside(tmp_path / "file.txt") == ["file.txt", "other.txt"]
    assert (tmp_path / "file.txt").read_text() == "later"


def test_links_and_modes_stay(tmp_path):
    real = tmp_path / "real.txt"
    real.write_text("old")
    real.chmod(0o640)
    (tmp_path / "link.txt").symlink_to(real)
    io.write_text("new", tmp_path / "link.txt", overwrite=True)
    assert (tmp_path / "link.txt").is_symlink() and real.read_text() == "new" and real.stat().st_mode & 0o777 == 0o640


# What writes to a path: the word that is called, and which of its calls do not make files.
OPENERS = {
    "open", "write_text", "write_bytes", "savefig", "to_csv", "to_parquet", "to_json", "to_excel", "to_hdf", "to_pickle",
    "to_netcdf", "to_zarr",
    "write_table", "save", "savez", "savez_compressed", "savetxt", "tofile", "dump", "savemat", "ZipFile", "replace_file",
    "rename", "touch", "symlink_to", "copyfile", "copy2", "move", "mkdir", "makedirs", "mkdtemp", "mkstemp", "NamedTemporaryFile",
}  # fmt: skip
HANDED = {
    ("io/csv_log.py", "to_csv"): "write_columns hands it the part",
    ("io/parquet_log.py", "write_table"): "write_columns hands it the part",
    ("io/mdf_log.py", "save"): "write_columns hands it the part",
    ("io/netcdf.py", "to_netcdf"): "into memory",
    ("io/netcdf.py", "rename"): "a dataset's variables",
    ("io/netcdf.py", "write_bytes"): "write_columns and save_result hand it the part",
    ("io/wide_parquet.py", "write_table"): "save_result hands it the part",
    ("plots/figure.py", "savefig"): "into memory",
    ("plots/style.py", "savefig"): "into memory",
    ("cli/output.py", "mkdir"): "the report's folder, which files are written into",
    ("cli/kept_programs.py", "mkdir"): "the user's cache folder, which jax writes into",
    ("cli/kept_programs.py", "touch"): "in the cache folder: what is there is damaged",
    ("sweeps/stored.py", "mkdir"): "the folder of a store, whose files Zarr writes beside their places",
    ("sweeps/store.py", "rename"): "a store that is complete, to its place, where nothing is",
    ("experiments/mass_grade_aukf/observed.py", "move"): "a state, to the next row",
    ("vehicles/fourteen_dof/car.py", "touch"): "of tyres and the road",
    ("estimators/leaning.py", "move"): "a belief, to the next row",
    ("estimators/pulling.py", "move"): "a belief, to the next row",
    ("estimators/roll/six_axis.py", "move"): "a belief, to the next row",
    ("estimators/sideslip_methods/observers.py", "move"): "a state, to the next row",
}


def test_nothing_else_opens_a_file_to_write():
    found = set()
    for file in ROOT.rglob("*.py"):
        place = file.relative_to(ROOT).as_posix()
        if place != "io/files.py":
            found |= {(place, word) for word in _writes(ast.parse(file.read_text("utf-8")), inside=False)}
    assert found == set(HANDED)


def _writes(node, inside):
    """The words of calls that write, outside of `with replacing_file(...)` and `with making_folder(...)`."""
    if isinstance(node, ast.With):
        words = {_word(item.context_expr) for item in node.items}
        inside = inside or bool(words & {"replacing_file", "making_folder"})
    if isinstance(node, ast.Call) and not inside and _word(node) in OPENERS and not (_reads(node) or _ours(node)):
        yield _word(node)
    for child in ast.iter_child_nodes(node):
        yield from _writes(child, inside)


def _word(call):
    function = getattr(call, "func", None)
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def _ours(call):
    """`plots.save`, `io.write_text` and `write_text` itself, which replace files."""
    if isinstance(call.func, ast.Name):
        return call.func.id == "write_text"
    name = getattr(call.func.value, "id", "")
    return (name, call.func.attr) in {("plots", "save"), ("io", "write_text")}


def _reads(call):
    """An `open` whose mode is for reading."""
    if _word(call) != "open":
        return False
    where = 1 if isinstance(call.func, ast.Name) else 0
    modes = [*call.args[where : where + 1], *(word.value for word in call.keywords if word.arg == "mode")]
    return all(isinstance(mode, ast.Constant) and not set(mode.value) & set("wax+") for mode in modes)


def test_every_writer_is_tried():
    """Those that call what replaces a file are those of the table above, and those that hand on to one of them."""
    calling = set()
    names = {"replacing_file", "making_folder", "write_columns", "write_text", "write_toml"}
    for file in ROOT.rglob("*.py"):
        text = file.read_text("utf-8")
        for function in ast.walk(ast.parse(text)) if any(name in text for name in names) else ():
            if isinstance(function, ast.FunctionDef):
                words = {_word(node) for node in ast.walk(function) if isinstance(node, ast.Call)}
                if words & names:
                    calling.add(function.name)
    tried = {name.partition(" ")[0] for name in (*WRITERS, *OTHERS)} | {"export_filter", "write_columns", "write_toml"}
    assert calling == tried


def test_numbers_can_be_read_back(tmp_path):
    output.write_numbers(tmp_path / "numbers.json", {"x": [0.5]}, {}, 0)
    assert json.loads((tmp_path / "numbers.json").read_text())["x"] == [0.5]

"""What a wheel that was installed alone can do, with the core's dependencies: `python smoke.py`, without pytest.

Every public module is imported, or says which extra it needs; a drive is simulated, filtered and differentiated; what needs an
extra names it.
"""

import importlib
import importlib.util
import os
import pathlib
import pkgutil
import subprocess
import sys
import sysconfig
import time

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_prefer_vector_width=512")
OPTIONAL = ("pandas", "matplotlib", "typer", "zarr", "mcap", "bokeh", "asammdf", "optax")


def check(holds: bool, words: object) -> None:
    if not holds:
        raise AssertionError(words)


def check_imports() -> None:
    import jaxveh

    home = pathlib.Path(jaxveh.__file__).resolve()
    assert pathlib.Path(sysconfig.get_paths()["purelib"]).resolve() in home.parents, (
        f"{home} is not the installed package"
    )
    assert (home.parent / "py.typed").exists()
    there = [name for name in OPTIONAL if importlib.util.find_spec(name)]
    assert not there, f"this environment has more than the core: {there}"
    for module in pkgutil.walk_packages(jaxveh.__path__, "jaxveh.", onerror=lambda name: None):
        if not module.name.startswith("jaxveh.cli.") and not module.name.endswith("__main__"):
            try:
                importlib.import_module(module.name)
            except jaxveh.InputError as error:
                check('pip install "jaxveh[' in str(error), error)


def check_estimates() -> None:
    import equinox as eqx
    import jax

    import jaxveh
    from jaxveh import estimators, filters, manoeuvres, sensors, vehicles

    jax.config.update("jax_enable_x64", True)
    device = sensors.esc(yaw_rate=0.005, a_y=0.1)
    car = vehicles.passenger_car()
    drive = jaxveh.simulate(car, manoeuvres.double_lane_change(25.0, 0.1), device, jax.random.key(0), dt=0.02)
    model = estimators.state_space(car, device, estimate=lambda car: (car.front.D, car.rear.D), prior=0.1)
    for filter in (filters.Unscented(), filters.ParticleFilter(50)):
        assert jaxveh.run(filter, model, drive, key=jax.random.key(1)).result == 0
    slope = jax.grad(lambda model: jaxveh.run(filters.Extended(), model, drive).log_likelihood)(model)
    assert jax.numpy.isfinite(slope.prior.mean.front_D)
    # One leaf alone is differentiated: each jax has rules of its own for the zeros of the others.
    at = lambda value: eqx.tree_at(lambda model: model.prior.mean.front_D, model, value)
    slope = jax.grad(lambda value: jaxveh.run(filters.Unscented(), at(value), drive).log_likelihood)(
        model.prior.mean.front_D
    )
    assert jax.numpy.isfinite(slope)


def check_extras() -> None:
    from jaxveh import InputError, io

    pathlib.Path("drive.csv").write_text("time,v_x\n0.0,1.0\n0.1,1.0\n")
    for extra, act in (
        ("io", lambda: io.read_recording("drive.csv")),
        ("plot", lambda: importlib.import_module("jaxveh.plots")),
    ):
        try:
            act()
        except InputError as error:
            check(f'pip install "jaxveh[{extra}]"' in str(error), error)
        else:
            raise AssertionError(f"nothing was said of the extra {extra}")
    program = pathlib.Path(sysconfig.get_path("scripts")) / "jaxveh"
    done = subprocess.run([str(program), "--version"], capture_output=True, text=True)
    assert done.returncode == 2 and 'pip install "jaxveh[cli,io,plot]"' in done.stderr, done.stderr


if __name__ == "__main__":
    begin = time.perf_counter()
    __import__("jax")
    alone = time.perf_counter()
    __import__("jaxveh")
    ours = time.perf_counter() - alone
    print(f"Python {sys.version.split()[0]}: import of jax {alone - begin:.1f} s, of jaxveh {ours:.2f} s more")
    check_imports()
    check_estimates()
    check_extras()
    print("wheel: sound")

"""Releases: `nox` builds wheel and sdist, and installs the wheel alone on each Python that is there (`pip install nox uv`).

`nox -s lowest`: the lower bounds of the dependencies. `nox -s tests`: the default tests on each Python; `.ci/run` has those of
the first alone.
"""

import pathlib
import runpy

import nox

nox.options.default_venv_backend = "uv|virtualenv"
nox.options.download_python = "never"
nox.options.error_on_missing_interpreters = False
nox.options.sessions = ["build", "wheel"]
PYTHONS = ["3.11", "3.12", "3.13", "3.14"]
DIST = pathlib.Path("build") / "dist"


@nox.session
def build(session: nox.Session) -> None:
    """Build wheel and sdist, and look at what they say of themselves."""
    session.install("build", "twine")
    session.run("python", "-m", "build", "--outdir", str(DIST), ".")
    session.run("twine", "check", "--strict", *map(str, files()))
    for file in files():
        session.log(f"{file.name}: {file.stat().st_size / 1e6:.2f} MB")


@nox.session(python=PYTHONS)
def wheel(session: nox.Session) -> None:
    """The wheel alone, with the jax that this Python gets."""
    (made,) = (file for file in files() if file.suffix == ".whl")
    session.install(str(made))
    smoke(session)


@nox.session(python=PYTHONS)
def tests(session: nox.Session) -> None:
    """The default tests, with the jax that this Python gets."""
    session.install(".[test]")
    session.run("python", "-m", "pytest", *session.posargs)


@nox.session(python="3.11", venv_backend="uv")
def lowest(session: nox.Session) -> None:
    """The lower bounds of `pyproject.toml`."""
    session.run_install("uv", "pip", "install", "--quiet", "--resolution", "lowest-direct", ".")
    smoke(session)


def files() -> list[pathlib.Path]:
    """What was built, the newest version alone."""
    version = runpy.run_path("jaxveh/_core/version.py")["VERSION"]
    return sorted(DIST.glob(f"jaxveh-{version}[.-]*"))


def smoke(session: nox.Session) -> None:
    """Run the smoke test outside of the checkout, so that the installed package is what is imported."""
    script = pathlib.Path("tests/release/smoke.py").resolve()
    session.chdir(session.create_tmp())
    session.run("python", str(script))

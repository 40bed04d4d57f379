"""How the command starts: flags, precision, missing libraries, as a process of its own."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import jax
import typer

import jaxveh
from jaxveh.cli import prepare
from jaxveh.cli.app import app

SETTINGS = "print(os.environ.get('XLA_FLAGS'), jax.config.jax_enable_x64)"
PROBE = f"import jaxveh, jaxveh.cli, os, jax; {SETTINGS}; jaxveh.cli.prepare(); {SETTINGS}"
"""What is set by importing, and what by a program's start."""


def python(*arguments, **environment):
    env = {name: value for name, value in os.environ.items() if name not in ("XLA_FLAGS", "JAX_ENABLE_X64")}
    # The package may be run from its folder, without being installed.
    path = [entry for entry in sys.path if entry]
    env = {**env, "PYTHONPATH": os.pathsep.join(path), **environment}
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, env=env, timeout=300)


def test_importing_sets_nothing_and_a_program_wide_vectors_and_float64():
    imported, prepared = python("-c", PROBE).stdout.splitlines()
    assert imported.split() == ["None", "False"]
    assert prepared.split() == ["--xla_cpu_prefer_vector_width=512", "True"]


def test_the_users_flag_stays(monkeypatch):
    monkeypatch.setenv("XLA_FLAGS", "--xla_cpu_prefer_vector_width=256")
    prepare()
    assert os.environ["XLA_FLAGS"] == "--xla_cpu_prefer_vector_width=256" and jax.config.jax_enable_x64


def test_without_the_extra_one_line_says_what_to_install():
    result = python("-c", "import sys; sys.modules['typer'] = None; from jaxveh.cli import main; main()")
    assert result.returncode == 2
    assert result.stderr.splitlines() == ['error: typer is not installed: run `pip install "jaxveh[cli,io,plot]"`.']


def test_bad_input_as_a_process(tmp_path):
    result = python("-m", "jaxveh.cli", "check", str(tmp_path / "missing.csv"))
    assert result.returncode == 2
    assert result.stdout == ""
    assert result.stderr.startswith(f"error: {tmp_path / 'missing.csv'}: cannot be read")
    assert len(result.stderr.splitlines()) == 1


OTHERS = {"--xla_cpu_prefer_vector_width", "--minutes", "--cars"}
"""Options of XLA, and of a study that is run as a module."""


def options_of(command):
    """Every option of a program and of those below it."""
    below = getattr(command, "commands", {}).values()
    return {one for parameter in command.params for one in parameter.opts}.union(*map(options_of, below))


def test_every_option_that_a_text_names_is_one():
    """`--values` for `--value` sent users to an option that no program has."""
    there, lost = options_of(typer.main.get_command(app)) | {"--help"} | OTHERS, []
    assert {"--value", "--steer-deg", "--car-file"} <= there
    for path in Path(jaxveh.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                lost += [
                    (path.name, one) for one in re.findall(r"(?<![-\w])--[a-z][\w-]+", node.value) if one not in there
                ]
    assert not lost

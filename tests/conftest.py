"""Tests run in float64 and strict dtype promotion; float32 tests ask for their dtype, or switch x64 off themselves.

The default run takes XLA's older code generator for the CPU without its slowest optimisations, which together compile in less
than half of the time: compiling is nearly all that the tests do. `-m full` and `-m peers` take the one that users have.
"""

import os
from importlib.metadata import version

import jax
import pytest

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")

QUICKLY_COMPILED = "--xla_cpu_use_fusion_emitters=false --xla_llvm_disable_expensive_passes=true"


def pytest_configure(config):
    """An unknown flag ends the process, so they are set for versions only that are known to have them."""
    if config.getoption("markexpr") == "not full" and version("jaxlib").startswith("0.10."):
        os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {QUICKLY_COMPILED}".strip()


@pytest.fixture
def float32():
    """Run one test as a user without x64 would."""
    with jax.enable_x64(False) if hasattr(jax, "enable_x64") else jax.experimental.disable_x64():
        yield

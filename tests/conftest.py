"""Tests run in float64 and strict dtype promotion; float32 tests ask for their dtype, or switch x64 off themselves."""

import jax
import pytest

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")


@pytest.fixture
def float32():
    """Run one test as a user without x64 would."""
    with jax.enable_x64(False) if hasattr(jax, "enable_x64") else jax.experimental.disable_x64():
        yield

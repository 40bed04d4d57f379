"""Traces of one module forgotten, for tests that replace what it asks while tracing.

`jax.clear_caches` would forget the programs of all tests.
"""


def forget_traces(*modules):
    """Forget what the modules' own jitted functions have traced."""
    for module in modules:
        for value in vars(module).values():
            if getattr(value, "__module__", "") == module.__name__ and hasattr(value, "clear_cache"):
                value.clear_cache()

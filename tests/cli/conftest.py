"""Programs of the tests hear interrupts, however the tests were started."""

import signal

import pytest


@pytest.fixture(autouse=True)
def interrupts_are_heard():
    """What a shell starts in its background ignores them, and so do its children."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)

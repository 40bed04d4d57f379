"""`python -m jaxveh.cli`, the same as `jaxveh`."""

from jaxveh.cli import main

main()

"""`python -m jaxveh`: the command `jaxveh`."""

from jaxveh.cli import main

if __name__ == "__main__":
    main()

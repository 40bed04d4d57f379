"""One line for each failure, and the exit code: 2 for input that the user can correct, 1 for a filter or fit that failed."""

from __future__ import annotations

import contextlib
import functools
import inspect
import typing
import warnings
from collections.abc import Callable, Iterator
from typing import Annotated

import typer

from jaxveh import FilterError, InputError, JaxvehWarning
from jaxveh.cli.console import messages, printable
from jaxveh.cli.kept_programs import is_of_damage

BAD_INPUT, FAILED, INTERRUPTED = 2, 1, 130

Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]


def program(function: Callable) -> Callable:
    """Make a command whose errors are one line on stderr and an exit code; its new option `--debug` shows the traceback."""

    @functools.wraps(function)
    def guarded(*args, debug: bool = False, **kwargs):
        with _warnings_in_words():
            if debug:
                return function(*args, **kwargs)
            with _errors_in_words():
                return function(*args, **kwargs)

    # typer needs annotations as objects; on the wrapper it would find only their text.
    hints = typing.get_type_hints(function, include_extras=True)
    own = [p.replace(annotation=hints[name]) for name, p in inspect.signature(function).parameters.items()]
    option = inspect.Parameter("debug", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Debug)
    guarded.__signature__ = inspect.Signature([*own, option])
    guarded.__annotations__ = {**hints, "debug": Debug}
    guarded.__doc__ = join_lines(function.__doc__ or "")
    return guarded


def join_lines(text: str) -> str:
    """Return a docstring with each paragraph on one line, so that the terminal can wrap it."""
    return "\n\n".join(" ".join(part.split()) for part in inspect.cleandoc(text).split("\n\n"))


@contextlib.contextmanager
def _errors_in_words() -> Iterator[None]:
    try:
        yield
    except InputError as error:
        _leave("error", error, BAD_INPUT)
    except FilterError as error:
        _leave("failed", error, FAILED)
    except OSError as error:
        # Reading and writing raise InputError themselves; this is an unforeseen error, such as a full disk.
        _leave("error", f"{error.filename or 'file'}: {error.strerror or error}", BAD_INPUT)
    except KeyboardInterrupt:
        _leave("stopped", "interrupted; no file was left half written", INTERRUPTED)
    except typer.Exit:
        raise
    except Exception as error:
        _leave("internal error", f"{type(error).__name__}: {error} (--debug shows where)", FAILED)


def _leave(kind: str, error: object, exit_code: int) -> None:
    say(kind, "red", error)
    raise typer.Exit(exit_code)


DAMAGE = (
    "a cached program from an earlier start is damaged: it is compiled again, and the next start compiles all again"
)


@contextlib.contextmanager
def _warnings_in_words() -> Iterator[None]:
    """Show jaxveh's own warnings as one line on stderr instead of Python's two lines with a path."""
    with warnings.catch_warnings():
        usual, told = warnings.showwarning, []

        def show(message, category, *rest, **more):
            if issubclass(category, JaxvehWarning):
                say("warning", "yellow", message)
            elif is_of_damage(str(message)):
                # jax repeats this warning for each program that it would cache.
                if not told:
                    say("note", "yellow", DAMAGE)
                told.append(message)
            else:
                usual(message, category, *rest, **more)

        warnings.showwarning = show
        yield


def say(kind: str, colour: str, message: object) -> None:
    """Print one unwrapped line on stderr: `kind: message`."""
    line = printable(" ".join(str(message).split()))
    messages().print(f"[bold {colour}]{kind}:[/] ", end="", soft_wrap=True)
    messages().print(line, markup=False, soft_wrap=True)

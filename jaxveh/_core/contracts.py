"""What a class of a user's own must take and return: checked by name while it is traced, before anything else trips over it."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, ClassVar

from jaxveh._core.errors import arguments_in_words
from jaxveh._core.traced_values import NO_VALUE, raise_with_place

Check = Callable[[str, Any, tuple, Any], None]
"""A check of a result: `check(who, self, given, result)` raises `InputError`; `who`: class and method, as in `Law.forces`."""


def contract(**checks: Check) -> Mapping[str, Check]:
    """The checks of a base class by the names of its methods."""
    return MappingProxyType(checks)


class Checked:
    """A base class of the package from which users derive their own: the results of the methods in its `_contract` are checked,
    and so is what they take."""

    __slots__ = ()

    _contract: ClassVar[Mapping[str, Check]] = contract()

    def __init_subclass__(cls, **given: Any):
        super().__init_subclass__(**given)
        checks = {
            name: check for base in reversed(cls.__mro__) for name, check in vars(base).get("_contract", {}).items()
        }
        for name in checks.keys() & vars(cls).keys():
            made = vars(cls)[name]
            if getattr(made, "__isabstractmethod__", False):
                continue
            _check_form(cls, name, made)
            if isinstance(made, property):
                setattr(cls, name, property(_with_check(made.fget, name, checks[name]), doc=made.__doc__))
            elif inspect.isfunction(made):
                setattr(cls, name, _with_check(made, name, checks[name]))


def check_unchanged(cls: type, base: type, why: str) -> None:
    """Raise `TypeError` if a class changes what a concrete class of the package, of the family `base`, defines; `why` it would
    not count. A class of one's own may be changed: nothing here knows it by its numbers."""
    for owner in cls.__mro__[1:]:
        ours = owner.__module__.partition(".")[0] == __name__.partition(".")[0]
        if owner is base or not ours or not issubclass(owner, base) or inspect.isabstract(owner):
            continue
        for name in vars(cls):
            if not name.startswith("_") and hasattr(owner, name):
                told = f"{cls.__name__}.{name}: cannot replace that of {owner.__name__}: {why}"
                raise TypeError(f"{told} Derive from {base.__name__}.")


def _with_check(method: Any, name: str, check: Check) -> Callable:
    @functools.wraps(method)
    def checked(self, *given, **options):
        who = f"{type(self).__name__}.{name}"
        try:
            result = method(self, *given, **options)
        except NO_VALUE as error:
            raise_with_place(error)
        check(who, self, (*given, *options.values()), result)
        return result

    return checked


def _check_form(cls: type, name: str, made: Any) -> None:
    """Raise `TypeError` unless a method takes what that of the base takes, and a property is one, or a plain value."""
    owner = next(one for one in cls.__mro__[1:] if name in vars(one))
    if isinstance(vars(owner)[name], property) and inspect.isfunction(made):
        raise TypeError(f"{cls.__name__}.{name}: is a property; write @property above it.")
    # Of a method of an equinox module the class has the function.
    base = getattr(owner, name)
    if not (inspect.isfunction(base) and inspect.isfunction(made)):
        return
    asked, takes = inspect.signature(base).parameters.values(), inspect.signature(made)
    told = [one.name for one in asked if one.kind is one.POSITIONAL_OR_KEYWORD]
    more = {"_any": None} if any(one.kind is one.VAR_KEYWORD for one in asked) else {}
    try:
        takes.bind(*told, **more)
    except TypeError:
        wanted, shown = map(arguments_in_words, (asked, takes.parameters.values()))
        raise TypeError(f"{cls.__name__}.{name}({shown}): must take ({wanted}).") from None

"""Units, scales and domains of every parameter, and the defaults of everything that makes up a car, as recorded.

A scale is the step of a random walk and of a search; nothing but its size depends on it, so that no other test would notice.
"""

import dataclasses
import inspect
import json
import os
from pathlib import Path

import numpy as np
import pytest

from jaxveh import roads, sensors, statespace, tyres, vehicles
from jaxveh.tyres import mf_tyre

ON_RECORD = Path(__file__).parents[1] / "recorded" / "test_recorded_parameters.json"
ROOMS = {
    "roads": roads,
    "sensors": sensors,
    "statespace": statespace,
    "tyres": tyres,
    "vehicles": vehicles,
    "MF-Tyre": mf_tyre,
}


def classes():
    """Every class of the rooms with fields."""
    for room, module in ROOMS.items():
        for name, one in sorted(vars(module).items()):
            if inspect.isclass(one) and dataclasses.is_dataclass(one) and not name.startswith("_"):
                yield f"{room}: {name}", one


def told(one):
    """Of each field what it is measured in, over what range, in what steps, and its default, where that is a number or a word."""
    found = {}
    for field in dataclasses.fields(one):
        about = {key: field.metadata.get(key) for key in ("unit", "scale") if field.metadata.get(key) is not None}
        domain = field.metadata.get("domain")
        about |= {} if domain is None else {"domain": repr(domain)}
        plain = isinstance(field.default, bool | int | float | str | np.ndarray)
        about |= {"default": str(field.default)} if plain else {}
        if about:
            found[field.name] = about
    return found


CLASSES = dict(classes())


@pytest.mark.parametrize("name", CLASSES)
def test_parameters_are_those_recorded(name):
    known = json.loads(ON_RECORD.read_text()) if ON_RECORD.exists() else {}
    if os.environ.get("JAXVEH_RECORD"):
        known[name] = told(CLASSES[name])
        ON_RECORD.write_text(json.dumps(dict(sorted(known.items())), indent=1) + "\n")
        return
    assert told(CLASSES[name]) == known[name]

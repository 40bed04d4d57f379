"""The note of a file that is written becomes comment lines at its top, whatever writes it."""

import inspect

import pytest

import jaxveh
from jaxveh import InputError, io, tyres, vehicles

THINGS = {
    "write_car": lambda: vehicles.specification_of(vehicles.sets.sedan()),
    "write_road": lambda: io.RoadSpecification(friction=0.8),
    "write_parameters": lambda: tyres.Linear(60000.0),
}
"""What each writer of TOML writes."""

WRITERS = {
    name: function
    for room in (getattr(jaxveh, name) for name in jaxveh.__all__)
    for name in getattr(room, "__all__", ())
    if inspect.isfunction(function := getattr(room, name)) and "note" in inspect.signature(function).parameters
}


def test_every_writer_with_a_note_is_here():
    others = {name for name in WRITERS if not name.startswith("write_")}
    assert set(WRITERS) - others == set(THINGS), others


@pytest.mark.parametrize("name", THINGS)
def test_a_note_becomes_comments(name, tmp_path):
    path = tmp_path / "a.toml"
    WRITERS[name](THINGS[name](), path, note="one\n\ntwo ")
    assert path.read_text().splitlines()[:3] == ["# one", "#", "# two"]


@pytest.mark.parametrize("note", [None, 3, ["one"]])
@pytest.mark.parametrize("name", THINGS)
def test_a_note_that_is_no_text_is_told(name, note, tmp_path):
    with pytest.raises(InputError, match="note = .*: must be text"):
        WRITERS[name](THINGS[name](), tmp_path / "a.toml", note=note)
    assert not list(tmp_path.iterdir())

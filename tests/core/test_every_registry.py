"""What programs know by name: each registry has every member of its family, or there is a reason why not."""

import inspect
import pathlib

import jax
import pytest
from families import kinds_in, members, wanting

import jaxveh
from jaxveh import estimators, experiments, fitting, manoeuvres, roads, tyres, vehicles
from jaxveh.cli.reproduce import PAPERS
from jaxveh.tyres.parameters_file import MODELS

OF_OTHERS = "is made of other laws, whose files are theirs"
ONE_LAW = ("FrictionEllipse", "LongitudinalLaw", "Mirrored", "OnRoad", "Relaxed", "Similarity")


def test_a_parameter_file_holds_every_law_of_plain_numbers():
    exempt = dict.fromkeys(ONE_LAW, OF_OTHERS) | {
        "FialaPolynomial": "has a switch for the paper's misprint, which is no law to hand on",
        "LuGre": "has an exponent that is fixed when compiling",
        "MFTyre": "has a property file of its own",
        "TMeasy": "has a curve for each direction and load, and no flat table of numbers",
    }
    assert not wanting(
        members("tyres", tyres.AbstractTyre), set(MODELS), exempt, "in MODELS of tyres/parameters_file.py"
    )


def test_a_rig_fit_starts_from_every_law_that_a_rig_can_tell():
    facts = fitting.kit.RigFacts(4000.0, 220e3, 16.7, 80e3, 60e3, 1.0)
    started = {type(make(facts)).__name__ for make in fitting.kit.RIG_STARTS.values()}
    exempt = dict.fromkeys(ONE_LAW, OF_OTHERS) | {
        "Arctangent": "has no peak, which a rig shows",
        "Exponential": "its sideways part alone saturates; fit it from a tyre of one's own (--start)",
        "FialaADAMS": "its second friction is seen far beyond the peak alone: --start",
        "FialaPolynomial": "the brush model without its trail: brush",
        "IsotropicMagicFormula": "one curve for both directions, which a rig contradicts: mf",
        "Linear": "has no load, over which a rig varies: linear-with-load",
        "LuGre": "a rig of steady slips shows nothing of its states",
        "Parabolic": "the brush model by another name: brush",
        "TMeasy": "its curves are read off by hand, not fitted",
    }
    assert not wanting(members("tyres", tyres.AbstractTyre), started, exempt, "in RIG_STARTS of fitting/rig_start.py")


def test_every_manoeuvre_has_a_name():
    made = [name.replace("-", "_") for name in manoeuvres.MANOEUVRES]
    kinds = (manoeuvres.AbstractManoeuvre, manoeuvres.AbstractDriver)
    public = [
        name
        for name in manoeuvres.__all__
        if inspect.isfunction(getattr(manoeuvres, name))
        and str(inspect.signature(getattr(manoeuvres, name)).return_annotation).split(".")[-1]
        in {one for kind in kinds for one in members("manoeuvres", kind) | {kind.__name__}}
    ]
    exempt = {
        "as_driver": "makes a driver of any manoeuvre",
        "replay": "needs a recording (--replay)",
    }
    assert not wanting(set(public), set(made), exempt, "in MANOEUVRES of manoeuvres/named.py")


def test_every_road_has_a_name():
    named = set().union(
        *(kinds_in(road.make(key=jax.random.key(0)) if road.random else road.make(), roads.AbstractRoad)
          for road in roads.ROADS.values())
    )  # fmt: skip
    exempt = {"Combined": "joins others", "Hill": "a road file has its heights", "Profile": "is what a road file makes"}
    assert not wanting(members("roads", roads.AbstractRoad), named, exempt, "in ROADS of roads/named.py")


def test_every_paper_has_a_name():
    folders = {path.parent.name for path in pathlib.Path(experiments.__file__).parent.glob("*/__init__.py")}
    assert not wanting(folders, {name.replace("-", "_") for name in PAPERS}, {}, "in PAPERS of cli/reproduce.py")
    assert folders <= set(experiments.__all__)


def test_the_readme_counts_what_there_is():
    readme = (pathlib.Path(jaxveh.__file__).parents[1] / "README.md").read_text()
    laws = members("tyres", tyres.AbstractTyre) - set(ONE_LAW)
    methods = [method for name in estimators.__all__ for method in getattr(getattr(estimators, name), "METHODS", ())]
    for number, what in ((len(laws), "laws"), (len(methods), "methods")):
        assert f"[{number} {what}]" in readme, f"README.md: there are {number} {what}"


def test_every_vehicle_can_be_made_by_name():
    kinds = {kind.__name__ for kind in vehicles.kit.FIDELITIES.values() if inspect.isclass(kind)}
    exempt = {
        "AntiLock": "goes around another, whose brakes it lets go",
        "Commanded": "goes around another: asked for by its inputs",
        "KinematicCrawl": "goes around the linear single track at a crawl",
        "Steered": "goes around another: --steering",
        "Travelling": "goes around another, which it gives a place",
    }
    assert not wanting(
        members("vehicles", vehicles.AbstractVehicle), kinds, exempt, "in FIDELITIES of vehicles/sets/named.py"
    )


@pytest.mark.parametrize("room", ["filters", "observers", "tyres", "vehicles", "sensors", "roads", "manoeuvres"])
def test_every_family_has_its_file(room):
    assert list((pathlib.Path(__file__).parents[1] / room).glob("test_every_*.py"))
    assert hasattr(jaxveh, room)

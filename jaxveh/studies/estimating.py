"""Estimators by name: the state space of any vehicle of the package, and the ready-made ones of `jaxveh.estimators`."""

from __future__ import annotations

import inspect
import operator
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from jaxveh import estimators, sensors
from jaxveh._core.errors import InputError
from jaxveh._core.parameter import every_parameter
from jaxveh._core.recording import Recording
from jaxveh.io import kit
from jaxveh.statespace import Gaussian, StateSpace
from jaxveh.studies.channels import hold
from jaxveh.studies.drives import Drive, car_of, specification_of
from jaxveh.studies.numbers import flat, with_numbers
from jaxveh.studies.settings import speed_and_steer


class NamedEstimator(NamedTuple):
    """How to make the estimator's own `car` from the study's tables, and a state-space `model` of that car; how to `clean` a
    recording for its filter, with inputs held from row to row; the `options` (its keys); and a line of `help`."""

    car: Callable[[Mapping[str, Any]], Any]
    model: Callable[[Any, Mapping[str, Any], Drive], StateSpace]
    clean: Callable[[StateSpace, Recording], Recording]
    options: tuple[str, ...]
    help: str


def estimator_of(settings: Mapping[str, Any]) -> NamedEstimator:
    """The estimator that the tables name."""
    told = settings["estimator"]
    if not isinstance(told.get("name"), str):
        raise InputError(f"estimator: name is missing; it must be one of {', '.join(ESTIMATORS)}.")
    kit.check_known("estimator", "estimator", told["name"], ESTIMATORS)
    found = ESTIMATORS[told["name"]]
    for key in told:
        kit.check_known(f"estimator {told['name']}", "key", key, ("name", *found.options))
    return found


def told_car(settings: Mapping[str, Any]) -> Any:
    """The estimator's own car: that of the file, with the numbers of the table `told`."""
    return with_numbers("told", estimator_of(settings).car(settings), flat(settings["told"]))


def model_of(settings: Mapping[str, Any], drive: Drive) -> StateSpace:
    """The filter's state space. It does not depend on the table `car`; of the drive it uses only the sensors' noise and the first
    speed."""
    return estimator_of(settings).model(told_car(settings), settings, drive)


def _track_car(settings: Mapping[str, Any]) -> Any:
    return car_of(settings["drive"]["vehicle"], settings["estimator"].get("fidelity", "single-track"))


def _track_model(car: Any, settings: Mapping[str, Any], drive: Drive) -> StateSpace:
    options = {name: value for name, value in settings["estimator"].items() if name not in ("name", "fidelity")}
    if "report" in options:
        options["report"] = tuple(options["report"])
    if "estimate" in options:
        options["estimate"] = where_of(options["estimate"], car)
    if "v_x" in car.state_type._fields and "v_x" not in car.inputs:
        options["start"] = {"v_x": speed_and_steer(settings["drive"])[0], **options.get("start", {})}
    return estimators.state_space(
        car, _as_told(settings, car, drive.sensors), process_noise=settings["process_noise"] or None, **options
    )


def _as_told(settings: Mapping[str, Any], car: Any, devices: Any) -> sensors.SensorSet:
    """The sensors in the filter's model: with their own noise, or that of `measurement_noise`; without the inputs of its
    car, which the model takes as measured."""
    told = dict(settings["measurement_noise"])
    if not isinstance(devices, sensors.SensorSet):
        if not told:
            raise InputError(
                f"measurement_noise: devices = {settings['sensors']['devices']!r} have no standard deviations for a filter: "
                "give them by channel, [measurement_noise] yaw_rate = 0.005, a_y = 0.1."
            )
        return sensors.SensorSet(Gaussian(told))
    noise = {name: std for name, std in {**devices.noise.std._asdict(), **told}.items() if name not in car.inputs}
    if not noise:
        raise InputError(
            f"sensors: measure only inputs of {type(car).__name__} ({', '.join(car.inputs)}); add an output, as yaw_rate."
        )
    return sensors.SensorSet(Gaussian(noise), devices.position, devices.low_pass)


def where_of(names: Any, car: Any) -> Callable[[Any], list]:
    """The function that picks the parameters of these dotted names from a car."""
    names = [names] if isinstance(names, str) else list(names)
    for name in names:
        kit.check_known("estimator.estimate", f"number of {type(car).__name__}", name, every_parameter(car))
    return lambda car: [operator.attrgetter(name)(car) for name in names]


def _ready_made(module: Any) -> NamedEstimator:
    """An estimator of `jaxveh.estimators` (`estimators/contract.py`) with its defaults: neither calibrated nor smoothed."""
    options = [p.name for p in inspect.signature(module.model).parameters.values() if p.kind is p.KEYWORD_ONLY]

    def model(car: Any, settings: Mapping[str, Any], drive: Drive) -> StateSpace:
        for table in ("process_noise", "measurement_noise"):
            if settings[table]:
                raise InputError(
                    f"{table}: {module.NAME} has its own noises; give {', '.join(options)} under [estimator], or numbers of its "
                    "car under [told]."
                )
        return module.model(car, **{name: value for name, value in settings["estimator"].items() if name != "name"})

    of_file = lambda settings: module.car_of(specification_of(settings["drive"]["vehicle"]))

    def clean(model: StateSpace, recording: Recording) -> Recording:
        cleaning = module.live(model).cleaning
        return estimators.kit.clean_recording(cleaning, hold(recording, cleaning.inputs or model.inputs))

    return NamedEstimator(of_file, model, clean, tuple(options), (module.__doc__ or "").partition("\n")[0])


OF_STATE_SPACE = (
    "fidelity",
    "estimate",
    "prior",
    "walk",
    "start",
    "start_spread",
    "minimum_speed",
    "report",
    "steps",
    "input_path",
)

ESTIMATORS: dict[str, NamedEstimator] = {
    "state-space": NamedEstimator(
        _track_car,
        _track_model,
        lambda model, recording: hold(recording, model.inputs),
        OF_STATE_SPACE,
        "a vehicle of the package with its sensors (estimators.state_space)",
    ),
    **{
        name.replace("_", "-"): _ready_made(getattr(estimators, name))
        for name in estimators.__all__
        if hasattr(getattr(estimators, name), "calibrate")
    },
}
"""Estimators by name."""

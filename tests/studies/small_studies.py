"""Small studies that the tests of this room share."""

from jaxveh import studies

DRIVE = {
    "drive": {"manoeuvre": "step-steer", "rate": 20.0, "speed": 20.0, "steer_deg": 1.0, "duration": 2.0},
    "metrics": {"names": ["rmse.sideslip", "coverage_95.yaw_rate"]},
    "seeds": 3,
}


def study(**tables):
    """The study of `DRIVE` with other tables; keys of `drive` beside its own."""
    told = {**DRIVE, **tables, "drive": {**DRIVE["drive"], **tables.get("drive", {})}}
    return studies.study_of(told)


def one_run(made, key):
    """The metrics of a study that varies nothing."""
    return made(made.design.point({}, {}), key)

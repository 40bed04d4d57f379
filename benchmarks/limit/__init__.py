"""A hand-vectorised C++ implementation: the limit of one core, for comparison with the library.

It solves exactly the problems of ``benchmarks.problems`` and returns the results that a user needs (means and log-likelihood),
so that its results can be checked as well as its time.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..mf_tyre_problem import COEFFICIENTS, Contacts
from ..problems import SingleTrack, SpeedAndMass
from ..seven_dof_problem import STATES, Drives
from .build import LimitUnavailable, build, library, unavailable

__all__ = [
    "LimitUnavailable",
    "ParticleResult",
    "TyreForces",
    "UnscentedResult",
    "build",
    "mf_tyre",
    "particle_filter",
    "seven_dof",
    "unavailable",
    "unscented",
]

_Doubles = ctypes.POINTER(ctypes.c_double)


class ParticleResult(NamedTuple):
    """Weighted means (rows, 11) and the log-likelihood of all rows."""

    mean: np.ndarray
    log_likelihood: float


class UnscentedResult(NamedTuple):
    """Means (rows, 3, runs) and the log-likelihood of each run (runs,)."""

    mean: np.ndarray
    log_likelihood: np.ndarray


class TyreForces(NamedTuple):
    """Forces (N) and moments (N m) of all contacts, (n,) each."""

    F_x: np.ndarray
    F_y: np.ndarray
    M_x: np.ndarray
    M_y: np.ndarray
    M_z: np.ndarray


class _ParticleProblem(ctypes.Structure):
    _fields_ = [("particles", ctypes.c_int), ("rows", ctypes.c_int)] + [
        (name, _Doubles)
        for name in [
            "steer",
            "speed",
            "yaw_rate",
            "lateral_acceleration",
            "car",
            "prior_mean",
            "prior_std",
            "process_std",
            "sensor_std",
        ]
    ]


class _UnscentedProblem(ctypes.Structure):
    _fields_ = [
        ("runs", ctypes.c_int),
        ("rows", ctypes.c_int),
        ("torque", _Doubles),
        ("speed", ctypes.c_void_p),
        *((name, _Doubles) for name in ["truck", "prior_mean", "prior_std", "process_std", "sensor_std", "spread"]),
    ]


class _DrivesProblem(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_int) for name in ("runs", "rows", "steps_a_row")),
        ("step", ctypes.c_double),
        *((name, _Doubles) for name in ("body", "own", "start", "steering")),
    ]


def _doubles(*values: object) -> np.ndarray:
    return np.ascontiguousarray(np.concatenate([np.atleast_1d(np.asarray(v, np.float64)) for v in values]))


def _pointer(array: np.ndarray) -> object:
    return array.ctypes.data_as(_Doubles)


def _is_single(dtype: np.typing.DTypeLike) -> bool:
    if np.dtype(dtype) not in (np.dtype(np.float32), np.dtype(np.float64)):
        raise ValueError(f"dtype is {np.dtype(dtype)}; the C++ limit computes in float32 or float64")
    return np.dtype(dtype) == np.float32


def particle_filter(
    problem: SingleTrack,
    particles: int,
    *,
    auxiliary: bool,
    dtype: np.typing.DTypeLike = np.float64,
    extra_flags: tuple[str, ...] = (),
) -> Callable[[int], ParticleResult]:
    """Return a bootstrap or auxiliary particle filter, ready to run, as a function of the seed.

    It uses systematic resampling before every step; the auxiliary filter looks ahead with the state propagated without noise.
    The first row weights draws from the prior. The array of means is overwritten by the next call.
    """
    if particles < 2:
        raise ValueError(f"particles is {particles}; at least 2 are needed")
    single = _is_single(dtype)
    function = library(extra_flags).jaxveh_particle_filter
    function.restype = ctypes.c_double
    function.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.c_uint64, ctypes.POINTER(_ParticleProblem), _Doubles]
    p = problem
    arrays = [
        _doubles(a)
        for a in (
            p.steer,
            p.speed,
            p.yaw_rate,
            p.lateral_acceleration,
            (p.mass, p.inertia, p.front, p.rear, p.step),
            p.prior_mean,
            p.prior_std,
            p.process_std,
            (p.yaw_rate_std, p.lateral_acceleration_std),
        )
    ]
    structure = _ParticleProblem(particles, p.rows, *map(_pointer, arrays))
    structure.arrays = arrays  # it points into them, so they live as long
    mean = np.zeros((p.rows, 11))

    def run(seed: int) -> ParticleResult:
        log_likelihood = function(single, auxiliary, seed, ctypes.byref(structure), _pointer(mean))
        return ParticleResult(mean, log_likelihood)

    return run


def unscented(
    problem: SpeedAndMass, *, dtype: np.typing.DTypeLike = np.float64, extra_flags: tuple[str, ...] = ()
) -> Callable[[], UnscentedResult]:
    """Return the unscented filter of all runs, ready to run. The result's arrays are overwritten by the next call."""
    single = _is_single(dtype)
    function = library(extra_flags).jaxveh_unscented
    function.restype = None
    function.argtypes = [ctypes.c_int, ctypes.POINTER(_UnscentedProblem), ctypes.c_void_p, ctypes.c_void_p]
    p = problem
    speed = np.ascontiguousarray(p.speed, dtype)
    arrays = [
        _doubles(a)
        for a in (
            (p.wheel_radius, p.gravity, p.rolling_resistance, p.drag, p.step),
            p.prior_mean,
            p.prior_std,
            p.process_std,
            p.speed_std,
            (p.alpha, p.beta, p.kappa),
        )
    ]
    torque = _doubles(p.torque)
    structure = _UnscentedProblem(p.runs, p.rows, _pointer(torque), speed.ctypes.data, *map(_pointer, arrays))
    structure.arrays = (arrays, torque, speed)  # it points into them, so they live as long
    result = UnscentedResult(np.zeros((p.rows, 3, p.runs), dtype), np.zeros(p.runs, dtype))

    def run() -> UnscentedResult:
        function(single, ctypes.byref(structure), result.mean.ctypes.data, result.log_likelihood.ctypes.data)
        return result

    return run


def mf_tyre(
    contacts: Contacts, *, dtype: np.typing.DTypeLike = np.float64, extra_flags: tuple[str, ...] = ()
) -> Callable[[], TyreForces]:
    """Return MF-Tyre 6.1 with `COEFFICIENTS` at all contacts, ready to run. The next call overwrites the result's arrays."""
    single = _is_single(dtype)
    compiled = library(extra_flags)
    compiled.jaxveh_mf_tyre_names.restype = ctypes.c_char_p
    names = compiled.jaxveh_mf_tyre_names().decode().split()
    coefficients = _doubles([COEFFICIENTS[name] for name in names])
    given = [np.ascontiguousarray(array, dtype) for array in contacts]
    found = TyreForces(*[np.empty_like(given[0]) for _ in TyreForces._fields])
    function = compiled.jaxveh_mf_tyre
    function.restype = None
    pointers = [(ctypes.c_void_p * len(arrays))(*[a.ctypes.data for a in arrays]) for arrays in (given, found)]

    def run() -> TyreForces:
        assert given  # the pointers point into these arrays, which must live as long
        function(single, len(given[0]), _pointer(coefficients), *pointers)
        return found

    return run


def seven_dof(
    problem: Drives, *, dtype: np.typing.DTypeLike = np.float64, extra_flags: tuple[str, ...] = ()
) -> Callable[[], np.ndarray]:
    """Return all drives, ready to run: states (8, rows, runs) at the end of each row. The next call overwrites the array.

    One run is computed in plain scalars, and only in float64.
    """
    single = _is_single(dtype)
    p = problem
    if p.runs == 1 and single:
        raise ValueError("one run is computed in float64 alone")
    function = library(extra_flags).jaxveh_seven_dof
    function.restype = None
    function.argtypes = [ctypes.c_int, ctypes.POINTER(_DrivesProblem), ctypes.c_void_p]
    torques = 0.5 * p.drive_torque * np.array([p.front_drive, 1 - p.front_drive])
    arrays = [
        _doubles(*p.body.values(), p.shape, p.curvature, torques),
        _doubles(p.mass, p.stiffness_front, p.friction_front, p.stiffness_rear, p.friction_rear),
        _doubles(p.speed),
        _doubles(p.steer(0.5 * p.step * np.arange(2 * p.steps + 1))),
    ]
    structure = _DrivesProblem(p.runs, p.rows, p.steps_a_row, p.step, *map(_pointer, arrays))
    structure.arrays = arrays  # it points into them, so they live as long
    found = np.zeros((len(STATES), p.rows, p.runs), dtype)

    def run() -> np.ndarray:
        function(single, ctypes.byref(structure), found.ctypes.data)
        return found

    return run

"""The weights of the neural network among the methods of sideslip, trained on cars that are in no table.

    python -m jaxveh.experiments.sideslip_review.network_training --out network.npz

simulates drives of `TRAINED_ON` in all scenarios of the chapters, prints for each candidate the error on each of these cars
after training on the others, and writes the weights of the best candidate, trained on all. The cars of the chapters
(`fleet.CARS`) are not used. Needs the extra `learn`; some minutes on two cores.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxveh._core.progress import Progress, part, silent
from jaxveh.estimators import learned
from jaxveh.experiments.sideslip_review.chapters import chapter_drives
from jaxveh.experiments.sideslip_review.chapters.fleet import told_cars
from jaxveh.experiments.sideslip_review.chapters.racing import LOST, STEP
from jaxveh.io import kit as io
from jaxveh.io import replacing_file
from jaxveh.sweeps import IN_MEMORY, Stores

TRAINED_ON = ("passenger_car", "suv", "race_car", "ev", "truck")
"""Cars of `vehicles.sets`, of other sources than those of the chapters."""

SEEDS, DURATION = 25, 40.0
"""Drives of each scenario, and s of each."""

EVERY = 5
"""One of so many rows of 0.01 s is used for training."""

SETTLED = 2.0
"""s at the beginning that are not used for training."""


class Candidate(NamedTuple):
    """Units of each of the two hidden layers, and the decay of the weights towards zero (AdamW)."""

    width: int
    decay: float


CANDIDATES = (Candidate(12, 1e-3), Candidate(12, 1e-1), Candidate(32, 1e-3), Candidate(32, 1e-1), Candidate(32, 1.0))


class Rows(NamedTuple):
    """The training data: `features` (N, size), `slip` of the rear axle (N,) in units of the network, `car` (N,)."""

    features: np.ndarray
    slip: np.ndarray
    car: np.ndarray


def learned_rows(
    seeds: int, key, *, duration: float = DURATION, progress: Progress = silent, stores: Stores = IN_MEMORY
) -> Rows:
    """Simulated drives as features and truths."""
    drives = chapter_drives(seeds, key, duration=duration, cars=TRAINED_ON, progress=progress, stores=stores)
    # The output of the network is not used here.
    blank = eqx.nn.MLP(learned.SideslipNetwork.size, 2, 1, 2, jnp.tanh, key=key)
    networks = [learned.sideslip_network(car, blank) for car in told_cars(TRAINED_ON)]
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *[eqx.filter(n, eqx.is_array) for n in networks])
    rest = eqx.filter(networks[0], eqx.is_array, inverse=True)

    @jax.jit
    def found(index, values):
        network = eqx.combine(jax.tree.map(lambda leaf: leaf[index], stacked), rest)
        return network_features(network, values), values["v_x"], network.rear_axle_to_cg * values["yaw_rate"]

    features, slips, cars = [], [], []
    for place in np.ndindex(drives["car"].shape):
        values = {name: _held(drives[name][place]) for name in ("v_x", "steer", "yaw_rate", "a_y")}
        index = int(drives["car"][place])
        read, v_x, rolling = (np.asarray(v) for v in found(index, values))
        truth = drives["true.sideslip"][place]
        held = np.cumprod(np.abs(truth) < LOST) > 0
        held[: round(SETTLED / STEP)] = False
        held &= v_x > float(networks[0].slowest) * 2.0
        which = np.flatnonzero(held)[::EVERY]
        features.append(read[which])
        slips.append((rolling / v_x - np.tan(truth))[which] / learned.SideslipNetwork.unit)
        cars.append(np.full(which.size, index))
    return Rows(np.concatenate(features), np.concatenate(slips), np.concatenate(cars))


def network_features(network, values) -> jax.Array:
    """Features (T, size) of a drive in rows of `STEP`."""
    time = STEP * jnp.arange(values["v_x"].shape[0])

    def body(memory, row):
        t, now = row
        (memory, _) = network.next(memory, t, now)
        v_x = jnp.maximum(now["v_x"], network.slowest)
        return memory, network.features(network.signals(now), memory.slow, v_x)

    first = jax.tree.map(lambda leaf: leaf[0], values)
    memory, _ = network.first(time[0], first)
    return jax.lax.scan(body, memory, (time, values))[1]


def _held(values: np.ndarray) -> np.ndarray:
    """The last measured value, 0 before the first."""
    last = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(values.size), -1))
    return np.where(last < 0, 0.0, np.nan_to_num(values)[np.maximum(last, 0)])


def trained_network(rows: Rows, candidate: Candidate, key, *, steps: int = 4000, batch: int = 1024, rate: float = 3e-3):
    """The network that predicts the rows' slips best, as Gaussians with their own standard deviations. Each car has equal
    weight."""
    optax = io.require("optax", "training a network", "learn")
    start_key, draw_key = jax.random.split(key)
    features, slip = jnp.asarray(rows.features), jnp.asarray(rows.slip)
    network = eqx.nn.MLP(features.shape[1], 2, candidate.width, 2, jnp.tanh, key=start_key)
    search = optax.adamw(optax.cosine_decay_schedule(rate, steps), weight_decay=candidate.decay)
    counts = np.bincount(rows.car)
    weight = jnp.asarray(np.cumsum(1.0 / counts[rows.car]))

    def cost(network, drawn):
        mean, spread = jax.vmap(network)(features[drawn]).T
        spread = jnp.clip(spread, -6.0, 3.0)
        return jnp.mean(spread + 0.5 * jnp.square((slip[drawn] - mean) * jnp.exp(-spread)))

    @eqx.filter_jit
    def walk(network, memory, key):
        arrays, rest = eqx.partition(network, eqx.is_array)

        def body(state, key):
            arrays, memory = state
            drawn = jnp.searchsorted(weight, weight[-1] * jax.random.uniform(key, (batch,), weight.dtype))
            slope = jax.grad(lambda one: cost(eqx.combine(one, rest), drawn))(arrays)
            change, memory = search.update(slope, memory, arrays)
            return (optax.apply_updates(arrays, change), memory), None

        (arrays, _), _ = jax.lax.scan(body, (arrays, memory), jax.random.split(key, steps))
        return eqx.combine(arrays, rest)

    with jax.numpy_dtype_promotion("standard"):
        return walk(network, search.init(eqx.filter(network, eqx.is_array)), draw_key)


def crossed_errors(rows: Rows, candidate: Candidate, key) -> tuple[np.ndarray, np.ndarray]:
    """Root mean square errors of the slip angle (rad), and of the error over its standard deviation, on each car after
    training on the others, (cars,) each."""
    errors, whitened = [], []
    for car in range(len(TRAINED_ON)):
        kept = rows.car != car
        index = np.cumsum(np.arange(len(TRAINED_ON)) != car) - 1
        others = Rows(rows.features[kept], rows.slip[kept], index[rows.car[kept]])
        network = trained_network(others, candidate, jax.random.fold_in(key, car))
        mean, spread = np.asarray(jax.vmap(network)(jnp.asarray(rows.features[~kept]))).T
        error = rows.slip[~kept] - mean
        errors.append(learned.SideslipNetwork.unit * np.sqrt(np.mean(error**2)))
        whitened.append(np.sqrt(np.mean((error / np.exp(np.clip(spread, -6.0, 3.0))) ** 2)))
    return np.array(errors), np.array(whitened)


def write_weights(path: Path, network, *, overwrite: bool = False) -> None:
    """Write the weights layer by layer, in float32. **Raises** `InputError` if the file exists, unless `overwrite`."""
    arrays = [leaf for layer in network.layers for leaf in (layer.weight, layer.bias)]
    with replacing_file(path, overwrite) as part, part.open("wb") as file:
        np.savez_compressed(file, **{f"{i:02d}": np.asarray(array, np.float32) for i, array in enumerate(arrays)})


def main(arguments: list[str], progress: Progress = silent) -> None:
    """Run the program that the module's docstring describes."""
    if len(arguments) != 2 or arguments[0] != "--out":
        raise SystemExit(__doc__)
    jax.config.update("jax_enable_x64", True)
    data_key, key = jax.random.split(jax.random.key(2013))
    rows = learned_rows(SEEDS, data_key, progress=part(progress, 0.0, 0.5, "drives"))
    print(
        f"{rows.slip.size} rows; slip angle {np.degrees(learned.SideslipNetwork.unit * np.std(rows.slip)):.2f} degrees"
    )
    best, least = CANDIDATES[0], np.inf
    for candidate in CANDIDATES:
        errors, whitened = crossed_errors(rows, candidate, key)
        told = ", ".join(
            f"{name} {np.degrees(e):.3f} ({w:.2f})" for name, e, w in zip(TRAINED_ON, errors, whitened, strict=True)
        )
        print(f"{candidate}: RMSE in degrees (error over standard deviation) on the car left out: {told}", flush=True)
        mean = float(np.exp(np.mean(np.log(errors))))
        if mean < least:
            best, least = candidate, mean
    network = trained_network(rows, best, jax.random.fold_in(key, 99), steps=8000)
    write_weights(Path(arguments[1]), network)
    print(f"{best} written to {arguments[1]}")


if __name__ == "__main__":
    main(sys.argv[1:])

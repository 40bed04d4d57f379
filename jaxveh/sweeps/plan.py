"""How the runs of a stored sweep are cut into chunks: blocks along its axes, so that each is a chunk of every stored
array."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np


class Chunk(NamedTuple):
    """One chunk: its combination of choices, where its block starts along the numbers' axes and the seeds, and how much of
    the block lies inside."""

    number: int
    choice: int
    start: tuple[int, ...]
    size: tuple[int, ...]


class Plan(NamedTuple):
    """`choices` combinations, each with runs of `shape` (numbers..., seeds), in blocks of `block` runs along the same axes."""

    choices: int
    shape: tuple[int, ...]
    block: tuple[int, ...]

    @property
    def blocks(self) -> tuple[int, ...]:
        """Number of blocks along each axis."""
        return tuple(-(-length // width) for length, width in zip(self.shape, self.block, strict=True))

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return self.choices * math.prod(self.blocks)

    @property
    def batch(self) -> int:
        """Number of runs of a whole chunk."""
        return math.prod(self.block)

    def chunk(self, number: int) -> Chunk:
        """The chunk of this number; the seeds vary fastest, the choices slowest."""
        choice, *place = np.unravel_index(number, (self.choices, *self.blocks))
        start = tuple(int(i) * width for i, width in zip(place, self.block, strict=True))
        size = tuple(min(w, n - s) for w, n, s in zip(self.block, self.shape, start, strict=True))
        return Chunk(number, int(choice), start, size)

    def runs(self, chunk: Chunk) -> np.ndarray:
        """The numbers of a chunk's runs, as many as its block has; those outside are replaced by the nearest inside."""
        along = [
            np.minimum(s + np.arange(w), n - 1) for s, w, n in zip(chunk.start, self.block, self.shape, strict=True)
        ]
        return np.ravel_multi_index(np.meshgrid(*along, indexing="ij"), self.shape).ravel()

    def inside(self, chunk: Chunk, values: np.ndarray) -> np.ndarray:
        """From the values (batch, ...) of a chunk's runs those inside, (*size, ...)."""
        block = values.reshape(*self.block, *values.shape[1:])
        return block[tuple(slice(size) for size in chunk.size)]


def plan_for(choices: int, shape: tuple[int, ...], batch: int) -> Plan:
    """Blocks of at most `batch` runs: as many seeds as fit, then as many of the last numbers, and so on."""
    block, left = [], batch
    for length in reversed(shape):
        width = max(1, min(length, left))
        block.append(width)
        left //= width
    return Plan(choices, shape, tuple(reversed(block)))

"""Drawings of the site, as SVG made by code."""

from notebooks.site.drawings import axes, cars, filters

DRAWINGS = {
    "axes": axes.from_above,
    "grade_and_bank": axes.grade_and_bank,
    "tyre": axes.tyre,
    "cars": cars.fidelities,
    "gaussian_step": filters.gaussian_step,
    "particle_step": filters.particle_step,
    "rooms": filters.rooms,
}
"""By the name of its file, what draws it."""

"""Friction, grade, bank and unevenness along a road: each road returns its surface at a given position."""

from jaxveh.roads.base import AbstractRoad, Surface
from jaxveh.roads.combined import Combined
from jaxveh.roads.friction import Level, MuJump, SplitMu
from jaxveh.roads.ground import LEVEL, Ground, under
from jaxveh.roads.named import ROADS, NamedRoad, from_specification, named_road
from jaxveh.roads.profile import INTERPOLATIONS, Profile
from jaxveh.roads.random_road import RandomRoad, Variation, band, gauss_markov
from jaxveh.roads.rough import ROUGHNESS, Rough, rough
from jaxveh.roads.slopes import Banked, Hill

__all__ = [
    "INTERPOLATIONS",
    "LEVEL",
    "ROADS",
    "ROUGHNESS",
    "AbstractRoad",
    "Banked",
    "Combined",
    "Ground",
    "Hill",
    "Level",
    "MuJump",
    "NamedRoad",
    "Profile",
    "RandomRoad",
    "Rough",
    "SplitMu",
    "Surface",
    "Variation",
    "band",
    "from_specification",
    "gauss_markov",
    "named_road",
    "rough",
    "under",
]

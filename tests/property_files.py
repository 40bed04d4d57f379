"""Property files for tests: those that the writer makes, a small one with all that is odd, and the shared ones."""

from shared_data import shared, shared_names

from jaxveh import io, tyres

SMALL = b"""\
! a comment = 1
[UNITS]
LENGTH = 'mm'
FORCE  = 'kN'   $ a comment
[MODEL]
PROPERTY_FILE_FORMAT = 'PAC2002'
USE_MODE = 14
TYRESIDE = LEFT
CONSTRUCTION = R20 16 x 7.5
ROAD_INCREMENT =
LONGVL = 16700
[INERTIA]
MASS = kg
[DIMENSION]
UNLOADED_RADIUS = 3.0d2
WIDTH = 0
[VERTICAL]
FNOMIN = 4
[SHAPE]
{radial width}
1.0 0.0
[LONGITUDINAL_COEFFICIENTS]
PCX1 = 1.6
PDX1 = 1.1
PKX1 = 22
[LATERAL_COEFFICIENTS]
PCY1 = 1.3
PDY1 = 1.0
PKY1 = -15
PKY2 = 1.7
"""


def own_files(folder):
    """What the project's writer makes of each version, with and without a template; and a small file with all that is odd."""
    small = folder / "small.tir"
    small.write_bytes(SMALL)
    path = folder / "own.tir"
    files = [SMALL]
    for version in (52, 61, 62):
        tyre = tyres.typical_mf_tyre(4000.0, version=version)
        for like in (None, io.read_property_file(small)):
            io.write_property_file(tyres.to_property_file(tyre, like), path, overwrite=True)
            files.append(path.read_bytes())
    return files


def shared_files():
    names = shared_names("tyres", "*.tir")
    return [(shared("tyres") / name).read_bytes() for name in names or ["a property file"]]


FILES = {"own": own_files, "shared": lambda folder: shared_files()}

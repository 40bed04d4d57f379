"""What is worth a look in property files drawn at random, as recorded: each finding with its numbers.

`test_property_check.py` says what is right, one finding at a time; here every coefficient, limit and value of a message is in
some file that has a finding because of it.
"""

import re

import numpy as np
import pytest
from recorded_numbers import check_recorded, check_words
from test_property_check import GOOD, OLD, found

from jaxveh import InputError, tyres

pytestmark = pytest.mark.whole

ADDED = {
    f"{name.upper()}_COEFFICIENTS": type(getattr(tyres.typical_mf_tyre(4000.0), name))
    for name in ("scaling", "longitudinal", "overturning", "lateral", "rolling", "aligning")
}
"""The coefficients of a section are the fields of its class."""

FILES = 96
NUMBER = re.compile(r"(?<![\w.])-?\d+\.?\d*(?:e[-+]?\d+)?(?![\w.])")
ANY_SIGN = re.compile(r"(?!PD.1)(L|P|Q|R)[A-Z]+\d?|ALPM..|KPUM..|CAMM..")
"""Keys whose number may be zero or negative. (Without friction rounding would decide what is found.)"""


def drawn(seed):
    """A good file with a few of its numbers changed or left out, and a few coefficients more."""
    random, good = np.random.default_rng(seed), OLD if seed % 3 == 0 else GOOD
    lines = []
    for line in good.splitlines():
        key, _, value = line.partition(" = ")
        if value and NUMBER.fullmatch(value) and key != "FITTYP" and random.uniform() < 0.12:
            line = "" if random.uniform() < 0.1 else f"{key} = {changed(random, key, float(value)):.6g}"
        lines.append(line)
        coefficients = ADDED.get(line.strip("[]"))
        if coefficients is not None:
            names = [name for name in coefficients.__dataclass_fields__ if f"\n{name} =" not in good]
            middle, often = (1.0, 0.06) if "SCALING" in line else (0.0, 0.4)
            more = random.normal(size=len(names)) * (random.uniform(size=len(names)) < often)
            lines += [f"{name} = {middle + one:.4g}" for name, one in zip(names, more, strict=True) if one]
    return "\n".join(lines) + "\n"


def changed(random, key, value):
    """Another number for a key: a near one, or one in another unit; of those that can have it also zero, one or its opposite."""
    near, unit = value * random.uniform(0.4, 1.8), value * random.choice([0.001, 0.1, 10.0, 1000.0])
    odd = [0.0, 1.0, -value] if ANY_SIGN.fullmatch(key) else []
    return random.choice([near, near, near, unit, *odd])


def findings(text):
    """Those of a file, or why it is refused."""
    try:
        return found(text)
    except InputError as refusal:
        return [str(refusal)]


@pytest.mark.parametrize("seed", range(FILES))
def test_findings_are_those_recorded(seed):
    said = findings(drawn(seed))
    check_words(__file__, f"{seed:02}", [NUMBER.sub("#", text) for text in said])
    numbers = [float(number) for text in said for number in NUMBER.findall(text)]
    numbers = [0.0 if abs(number) < 1e-12 else number for number in numbers]
    # Three digits are told.
    check_recorded(__file__, f"{seed:02}", {"numbers": np.asarray(numbers)}, rtol=0.01, given=True)

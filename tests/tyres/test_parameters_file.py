"""Parameter files of tyres: what is written is read again, and a person's slips are named."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxveh import InputError, tyres
from jaxveh.tyres.parameters_file import MODELS

TYRES = [
    tyres.Brush(91234.56789012, 1e5 / 3, 0.95),
    tyres.Brush(9e4, 6e4, slides="against velocity"),
    tyres.Dugoff(9e4, 6e4, 0.9, 0.001),
    tyres.MagicFormula(B=10.0, C=1.3, D=4000.0, E=-0.5, S_h=1e-7),
    tyres.LinearWithLoad(8e4, 6000.0),
    tyres.UniTire(9e4, 6e4, 0.9, -0.2),
]


def write(tmp_path, text):
    path = tmp_path / "tyre.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("tyre", TYRES, ids=lambda tyre: type(tyre).__name__)
def test_tyres_come_back(tyre, tmp_path):
    path = tmp_path / "tyre.toml"
    tyres.write_parameters(tyre, path, note="From a drum.\nDry.")
    found = tyres.read_parameters(path)
    assert type(found) is type(tyre) and jax.tree.structure(found) == jax.tree.structure(tyre)
    assert jax.tree.leaves(found) == jax.tree.leaves(tyre)
    assert path.read_text().startswith("# From a drum.\n# Dry.\n# SI units and radians.\n[tyre]\nmodel = ")


@pytest.mark.parametrize("name", MODELS)
def test_every_model_is_of_numbers_and_words_alone(name, tmp_path):
    numbers = [field for field in dataclasses.fields(MODELS[name]) if "unit" in field.metadata]
    tyre = MODELS[name](**{field.name: jnp.asarray(0.5 + 0.1 * k) for k, field in enumerate(numbers)})
    tyres.write_parameters(tyre, tmp_path / "tyre.toml")
    assert jax.tree.leaves(tyres.read_parameters(tmp_path / "tyre.toml")) == jax.tree.leaves(tyre)


def test_it_is_a_file_that_a_person_can_read(tmp_path):
    tyres.write_parameters(TYRES[0], tmp_path / "tyre.toml")
    assert (tmp_path / "tyre.toml").read_text() == (
        "# SI units and radians.\n"
        "[tyre]\n"
        'model = "Brush"\n'
        "slip_stiffness      = 91234.56789012  # N\n"
        "cornering_stiffness = 33333.333333333336  # N/rad\n"
        "friction            = 0.95\n"
        "half_length         = 0.06  # m\n"
        'slides              = "along deflection"\n'
    )


def test_single_precision_is_written_with_its_own_digits(tmp_path, float32):
    tyre = tyres.Brush(9e4, 6e4, 0.95)
    tyres.write_parameters(tyre, tmp_path / "tyre.toml")
    assert "friction            = 0.95\n" in (tmp_path / "tyre.toml").read_text()
    assert np.asarray(tyres.read_parameters(tmp_path / "tyre.toml").friction) == np.float32(0.95)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[tire]\n", r"no table \[tyre\]"),
        ("[tyre]\nfriction = 1\n", "has no `model`; it must be one of Arctangent, Brush"),
        ('[tyre]\nmodel = "Brsh"\n', "no model 'Brsh' .did you mean 'Brush'"),
        ('[tyre]\nmodel = "Brush"\nmu = 1\n', r"of Brush: no key 'mu'"),
        (
            '[tyre]\nmodel = "Brush"\nslip_stiffness = 9e4\n',
            r"cornering_stiffness is missing; Brush needs it \(N/rad\)",
        ),
        (
            '[tyre]\nmodel = "HSRI"\nslip_stiffness = "9"\ncornering_stiffness = 1\n',
            "slip_stiffness = '9': must be a finite",
        ),
        ('[tyre]\nmodel = "HSRI"\nslip_stiffness = 1\ncornering_stiffness = -1\n', "HSRI.cornering_stiffness = -1"),
        ("tyre\n", "broken TOML"),
    ],
)
def test_slips_are_named(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        tyres.read_parameters(write(tmp_path, text))


def test_what_cannot_be_written_is_named(tmp_path):
    with pytest.raises(InputError, match="MFTyre: must be one of .*to_property_file"):
        tyres.write_parameters(tyres.typical_mf_tyre(4e3), tmp_path / "tyre.toml")
    many = jax.vmap(lambda mu: tyres.Brush(9e4, 6e4, mu))(jnp.asarray([0.8, 0.9]))
    with pytest.raises(InputError, match="must be one finite number"):
        tyres.write_parameters(many, tmp_path / "tyre.toml")
    path = write(tmp_path, "")
    with pytest.raises(InputError, match="exists already"):
        tyres.write_parameters(TYRES[0], path)

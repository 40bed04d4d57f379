"""`jaxveh tyre show` of property files spoilt at random: shown, or refused in words."""

import pytest
from mutations import mutations
from programs import run
from property_files import FILES

SHOWN, MANY_SHOWN = 8, 300


def check_shown(files, count, seed, folder):
    path = folder / "odd.tir"
    for data in mutations(seed, files, count):
        path.write_bytes(data)
        result = run("tyre", "show", path)
        assert result.exit_code in (0, 2), result.output
        assert "Traceback" not in result.output


@pytest.mark.parametrize("files", FILES)
def test_the_program_shows_it_or_refuses_it(files, tmp_path):
    check_shown(FILES[files](tmp_path), SHOWN, 11, tmp_path)


@pytest.mark.full
@pytest.mark.parametrize("files", FILES)
def test_the_program_shows_it_or_refuses_it_many_times(files, tmp_path):
    check_shown(FILES[files](tmp_path), MANY_SHOWN, 12, tmp_path)

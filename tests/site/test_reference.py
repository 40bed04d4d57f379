"""The reference has every public name, with words for it and for each of its arguments; every module is in the site's nav."""

import functools
import re

import pytest
import yaml

from notebooks.site import reference
from notebooks.site.executed import ROOT
from notebooks.site.pages import sources

ENTRIES = reference.public_entries()
NAV = (ROOT / "mkdocs.yml").read_text().split("\nnav:\n")[1]


@pytest.mark.parametrize("module", ENTRIES)
def test_every_public_name_has_words_and_each_argument_too(module):
    silent = []
    for entry in ENTRIES[module]:
        text = reference.text_of(entry.value) if callable(entry.value) else reference.text_of_value(entry)
        if not text.strip():
            silent.append(entry.path)
        silent += [f"{entry.path}({a.name})" for a in reference.arguments_of(entry) if not a.words]
    assert not silent


@pytest.mark.parametrize("module", reference.public_modules())
def test_what_a_module_lists_has_an_entry_somewhere(module):
    import importlib
    import inspect

    everywhere = {id(entry.value) for entries in ENTRIES.values() for entry in entries}
    here = {entry.name for entry in ENTRIES.get(module, [])}
    listed = importlib.import_module(module)
    lost = [
        name for name in listed.__all__
        if not name.startswith("__") and name not in here
        and not inspect.ismodule(value := getattr(listed, name)) and id(value) not in everywhere
    ]  # fmt: skip
    assert not lost


def test_the_nav_has_each_module_and_each_page():
    from notebooks.site.pages import SOURCES

    named = set(re.findall(r"[\w./-]+\.md", NAV))
    made = {f"{reference.PLACE}/{reference.page_of(module)}" for module in ENTRIES}
    made |= {f"tutorials/{path.stem}.md" for path in (SOURCES / "tutorials").glob("*.ipynb")}
    written = {place for place in sources() if not place.startswith(f"{reference.PLACE}/")}
    assert not [f"{page}: put it into the nav of mkdocs.yml" for page in (made | written) - named]
    assert not [f"{page}: is in the nav of mkdocs.yml, and nowhere else" for page in named - (made | written)]
    assert yaml.safe_load("nav:\n" + NAV)


def test_a_signature_and_its_arguments():
    (entry,) = (entry for entry in ENTRIES["jaxveh.filters"] if entry.name == "Unscented")
    assert reference.signature_of(entry) == "filters.Unscented(alpha=1.0, beta=2.0, kappa=0.0, form=Covariance())"
    (car,) = (entry for entry in ENTRIES["jaxveh.vehicles"] if entry.name == "SevenDOF")
    words = {a.name: a.words for a in reference.arguments_of(car)}
    assert words["wheel_inertia"] == "kg m^2, of one wheel, positive"
    assert words["steering"] != words["wheel_radius"]


def test_a_function_that_is_made_by_another_has_its_signature_and_its_text(tmp_path):
    reference.write_reference(tmp_path, tmp_path, {})
    page = (tmp_path / reference.page_of("jaxveh.estimators.navigation")).read_text()
    assert "estimators.navigation.estimate(source, recording, method='rear_axle')" in page
    assert "`sideslip` (rad) along a log." in page and "::: jaxveh.estimators.navigation.estimate" not in page


def test_an_example_is_the_shortest_statement_that_uses_a_name():
    pages = {
        "a.md": "```python\nx = filters.run(filters.Kalman(), model, drive)\nfilters.run\n```\n",
        "b.md": "```text\nfilters.run\n```\n",
    }
    assert reference.usages(pages)["filters.run"] == [
        ("a.md", "filters.run"),
        ("a.md", "x = filters.run(filters.Kalman(), model, drive)"),
    ]


NO_EXAMPLE: dict[str, str] = {}
"""Names that no page can show, each with the reason."""


@functools.cache
def uses():
    """What every page's code uses."""
    return reference.usages({place: path.read_text() for place, path in sources().items()})


@pytest.mark.whole
@pytest.mark.parametrize("module", ENTRIES)
def test_every_public_name_has_an_example(module):
    lacking = [entry.short for entry in ENTRIES[module] if not reference.has_example(entry, uses())]
    place = f"notebooks/reference/{reference.page_of(module)}"
    assert not [f"{name}: show it in {place}, or on another page" for name in lacking if name not in NO_EXAMPLE]


def test_what_is_excused_is_public_and_lacks_an_example():
    everything = [entry for entries in ENTRIES.values() for entry in entries]
    assert set(NO_EXAMPLE) <= {entry.short for entry in everything if not reference.has_example(entry, uses())}


@pytest.mark.parametrize(
    "path", sorted((ROOT / "notebooks" / reference.PLACE).glob("*.md")), ids=lambda path: path.stem
)
def test_a_head_is_of_a_module_and_begins_with_its_name(path):
    modules = {reference.page_of(module): module for module in ENTRIES}
    assert path.name in modules
    assert path.read_text().startswith(f"# {modules[path.name]}\n")

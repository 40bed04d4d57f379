"""Pages as they are put together: equations, what blocks print, captions, drawings."""

import xml.etree.ElementTree as ET

import pytest

from notebooks.site import executed, pages
from notebooks.site.drawings import DRAWINGS
from notebooks.site.maths import draw_equations

PAGE = """# A page

```toml title="car.toml"
mass = 1.0
```

```python
text = open("car.toml").read()
print(text.strip())
```

```sh
cat car.toml | tr a-z A-Z
```

```python
import matplotlib.figure

figure = matplotlib.figure.Figure()
figure.add_subplot().plot([0, 1])
figure
```

Figure: A line, in metres.

```text
not run
```
"""


def test_blocks_run_in_one_folder_and_one_namespace(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(PAGE)
    outputs = executed.run_page(page, tmp_path / "left" / "page")
    assert [one["text"].strip() for one in outputs] == ["", "mass = 1.0", "MASS = 1.0", "", ""]
    assert (tmp_path / "left" / "page" / outputs[3]["figure"]).stat().st_size > 1000
    shown = pages._with_outputs("page.md", PAGE, tmp_path / "site", tmp_path / "left")
    assert "```text\nmass = 1.0\n```" in shown and "Figure:" not in shown
    assert "<figcaption>A line, in metres.</figcaption>" in shown
    assert (tmp_path / "site" / "figures" / f"page-{outputs[3]['figure']}").exists()


def test_what_an_older_text_printed_is_not_shown(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("```python\nprint(1)\n```\n")
    executed.run_page(page, tmp_path / "left" / "page")
    shown = pages._with_outputs("page.md", "```python\nprint(2)\n```\n", tmp_path, tmp_path / "left")
    assert "```text" not in shown


def test_a_page_that_was_not_run_is_shown_without_outputs(tmp_path):
    assert "Figure:" not in pages._with_outputs("page.md", PAGE, tmp_path, tmp_path / "nothing")


@pytest.mark.parametrize("code", ["```python\n1 / 0\n```\n", "```sh\nfalse\n```\n"])
def test_a_page_whose_code_fails_says_so(code, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(code)
    with pytest.raises((ZeroDivisionError, RuntimeError)):
        executed.run_page(page, tmp_path / "left")


def test_long_output_is_folded():
    assert pages._printed("one\ntwo").strip() == "```text\none\ntwo\n```"
    assert pages._printed("\n".join("x" * 40)).startswith('\n\n??? quote "What it prints"')


def test_equations_are_drawn_and_code_is_left_alone():
    pytest.importorskip("latex2mathml", reason="needs the extra docs")
    drawn = draw_equations(
        "It costs $5 and `$x$`.\n\n$$m \\dot v = F$$\n\nwith $\\alpha$ here\n\n```sh\necho $HOME $PATH\n```\n"
    )
    assert drawn.count("<math") == 2 and "`$x$`" in drawn and "echo $HOME $PATH" in drawn and "costs $5" in drawn


@pytest.mark.parametrize("name", DRAWINGS)
def test_a_drawing_is_svg_with_a_title_and_stays_on_its_page(name):
    root = ET.fromstring(DRAWINGS[name]())
    width, height = (float(root.get(side)) for side in ("width", "height"))
    spaces = {"svg": "http://www.w3.org/2000/svg"}
    assert len(root.find("svg:title", spaces).text) > 20
    for text in root.iterfind(".//svg:text", spaces):
        assert 0 <= float(text.get("x")) <= width and 0 <= float(text.get("y")) <= height
    assert f"drawings/{name}.svg" in "".join(path.read_text() for path in pages.sources().values()), "shown on a page"

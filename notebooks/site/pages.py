"""Puts the pages of the site together in a folder: guides with their outputs, notebooks, drawings and the reference."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from notebooks.site.drawings import DRAWINGS
from notebooks.site.executed import blocks_of, outputs_of
from notebooks.site.maths import draw_equations
from notebooks.site.reference import PLACE, write_reference

SOURCES = Path(__file__).resolve().parents[1]
CAPTION = re.compile(r"\n+Figure: (.+?)(?=\n\n|\Z)", re.S)
HIDDEN = "site"
FOLDED_FROM = 24
"""Lines of output from which it is folded."""


def sources() -> dict[str, Path]:
    """Every hand-written page, by its place in the site."""
    return {
        str(path.relative_to(SOURCES)): path for path in sorted(SOURCES.rglob("*.md")) if HIDDEN not in path.parts[:-1]
    }


def put_together(folder: Path, executed: Path) -> None:
    """Make the site's pages in a new folder, with the outputs of their code from `executed` (a folder for each page), if any."""
    if folder.exists():
        shutil.rmtree(folder)
    texts = {place: path.read_text() for place, path in sources().items()}
    for place, text in texts.items():
        if not place.startswith(f"{PLACE}/"):
            _write(folder / place, _with_outputs(place, text, folder, executed))
    for path in sorted((SOURCES / "tutorials").glob("*.ipynb")):
        run = executed / path.stem / path.name
        _write_notebook(run if run.exists() else path, folder / "tutorials")
    heads = folder / ".heads"
    for place in [place for place in texts if place.startswith(f"{PLACE}/")]:
        _write(heads / place, _with_outputs(place, texts[place], folder, executed))
    write_reference(heads / PLACE, folder / PLACE, texts)
    shutil.rmtree(heads, ignore_errors=True)
    drawings = folder / "drawings"
    drawings.mkdir(parents=True, exist_ok=True)
    for name, draw in DRAWINGS.items():
        (drawings / f"{name}.svg").write_text(draw())
    for path in (*SOURCES.glob("*.png"), *(SOURCES / "site" / "assets").glob("*")):
        shutil.copy(path, folder / path.name)
    for path in (SOURCES / "tutorials").glob("*.png"):
        shutil.copy(path, folder / "tutorials" / path.name)


def name_of(place: str) -> str:
    """The name of the folder with the outputs of a page's code."""
    return place.removesuffix(".md").replace("/", "-")


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(draw_equations(text))


def _with_outputs(place: str, text: str, folder: Path, executed: Path) -> str:
    """A page with the output of each block below it, and its figure in place of the line that begins with `Figure:`."""
    left = executed / name_of(place)
    outputs = outputs_of(text, left)
    blocks = blocks_of(text)
    if len(outputs) != len(blocks):
        return CAPTION.sub("", text)
    parts, begin = [], 0
    for block, output in zip(blocks, outputs, strict=True):
        parts.append(text[begin : block.end])
        begin = block.end
        if output["text"].strip():
            parts.append(_printed(output["text"].rstrip()))
        if output["figure"]:
            figures = folder / "figures"
            figures.mkdir(exist_ok=True, parents=True)
            shutil.copy(left / output["figure"], figures / f"{name_of(place)}-{output['figure']}")
            caption = CAPTION.match(text, begin)
            words = " ".join(caption[1].split()) if caption else ""
            begin = caption.end() if caption else begin
            up = "../" * place.count("/")
            parts.append(_figure(f"{up}figures/{name_of(place)}-{output['figure']}", words))
    return "".join([*parts, text[begin:]])


def _printed(text: str) -> str:
    """The output of a block; folded if it is long."""
    fence = f"```text\n{text}\n```"
    if text.count("\n") < FOLDED_FROM:
        return f"\n\n{fence}"
    return '\n\n??? quote "What it prints"\n\n' + "\n".join(f"    {line}" for line in fence.splitlines())


def _figure(path: str, caption: str) -> str:
    return f'\n\n<figure markdown="span">\n![{caption}]({path})\n<figcaption>{caption}</figcaption>\n</figure>'


def _write_notebook(path: Path, folder: Path) -> None:
    """Write a notebook as a page, with its figures beside it."""
    from nbconvert import MarkdownExporter

    text, made = MarkdownExporter().from_filename(
        str(path), resources={"output_files_dir": f"{path.stem}_files", "unique_key": path.stem}
    )
    _write(folder / f"{path.stem}.md", re.sub(r"<style[^>]*>.*?</style>", "", text, flags=re.S))
    for name, content in made.get("outputs", {}).items():
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)

"""Build the site: `python -m notebooks.site`, from the project's root, with `pip install -e ".[docs]"`.

The output and the figures of the pages' code are taken from the folder `--executed`. `--execute` runs every page whose output
is not there yet (a minute or two for each notebook; `JAXVEH_SMOKE=1` runs them at a small size). `--builder mkdocs` builds with
Material for MkDocs, whose link check is stricter.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

from notebooks.site.executed import ROOT, blocks_of, is_run, outputs_of
from notebooks.site.pages import SOURCES, name_of, put_together, sources

BUILD = ROOT / "build" / "site"


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m notebooks.site", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--execute", action="store_true", help="run the code of pages whose output is not there yet")
    parser.add_argument("--executed", type=Path, default=BUILD / "executed", help="folder with the output of the code")
    parser.add_argument("--builder", choices=("zensical", "mkdocs"), default="zensical")
    given = parser.parse_args()
    if given.execute:
        execute(given.executed)
    put_together(BUILD / "pages", given.executed)
    return build(given.builder)


def execute(folder: Path) -> None:
    """Run every page and notebook whose output is not in the folder, each in a separate process."""
    for place, page in sources().items():
        text = page.read_text()
        if any(map(is_run, blocks_of(text))):
            left = folder / name_of(place)
            if not outputs_of(text, left):
                print(f"running {place}", flush=True)
                subprocess.run(
                    [sys.executable, "-m", "notebooks.site.executed", str(page), str(left)], check=True, cwd=ROOT
                )
    for page in sorted((SOURCES / "tutorials").glob("*.ipynb")):
        left = folder / page.stem
        if not (left / page.name).exists():
            print(f"running {page.name}", flush=True)
            run_notebook(page, left)


def run_notebook(page: Path, folder: Path) -> None:
    """Run a notebook and save it with its outputs in the folder."""
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(page, as_version=4)
    NotebookClient(notebook, timeout=1200, resources={"metadata": {"path": str(page.parent)}}).execute()
    folder.mkdir(parents=True, exist_ok=True)
    nbformat.write(notebook, folder / page.name)


def build(builder: str) -> int:
    """Build in strict mode and return the exit status."""
    # Both builders find the configuration's extensions from the project's root.
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1"}
    command = {
        "zensical": [sys.executable, "-m", "zensical", "build", "--clean", "--strict"],
        "mkdocs": [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(BUILD / "mkdocs")],
    }[builder]
    return subprocess.run(command, cwd=ROOT, env=environment).returncode


if __name__ == "__main__":
    raise SystemExit(main())

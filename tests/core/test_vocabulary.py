"""One word, one meaning: functions are named by what they return or do; words that the glossary replaces stand nowhere."""

import ast
import importlib
import inspect
import json
import re

import pytest
from test_names_in_docstrings import ROOMS, ROOT, everywhere, exists, trees

pytestmark = pytest.mark.whole

TOP = ROOT.parent
PAGES = sorted((TOP / "notebooks").rglob("*.md"))
IRREGULAR = {
    "begun", "bent", "bound", "brought", "built", "caught", "chosen", "cut", "done", "drawn", "driven", "fed", "felt",
    "found", "frozen", "given", "gone", "grown", "held", "hidden", "kept", "known", "laid", "led", "left", "lost", "made",
    "meant", "paid", "redone", "said", "seen", "sent", "shown", "sold", "spent", "split", "stuck", "sunk", "taken", "taught",
    "told", "torn", "understood", "unknown", "unseen", "untold", "won", "wound", "written",
}  # fmt: skip
NOUNS = {
    "bearing", "bed", "bound", "braking", "breed", "building", "cornering", "crossing", "cut", "damping", "driving", "feed",
    "filtering", "fitting", "heading", "left", "listing", "loading", "logging", "mapping", "need", "parking", "reading",
    "recording", "red", "resampling", "ring", "rolling", "sampling", "seed", "setting", "smoothing", "spacing", "speed",
    "split", "steering", "string", "swing", "timing", "warning", "weighting",
}  # fmt: skip
PARTICLES = {
    "again", "all", "apart", "as", "at", "away", "back", "before", "by", "first", "for", "from", "in", "of", "off", "on",
    "once", "out", "over", "then", "to", "up", "when", "with",
}  # fmt: skip
EXEMPT = {
    "as_printed": "what every paper's package has: the study as the paper prints it",
    "stratified": "the field's name of a scheme, beside `systematic` and `multinomial`",
    "unscented": "the field's name of a transform",
    "passed": "a truth value of a test",
    "converged": "a truth value of a fit",
}
ELSEWHERE = {
    "JAXVEH_SHARED": "a variable of the environment", "JAXVEH_CACHE": "a variable of the environment",
    "peers": "a marker of tests", "thorough": "a marker of tests", "seldom": "a marker of tests", "rare": "a marker of tests",
    "open_zarr": "xarray's",
    "log.ay": "a column of a file", "log.ay.Data": "a part of a file",
    "log.ay.Time": "a part of a file", "log.vx.Data": "a part of a file", "log.vx.Time": "a part of a file", "sh": "a language",
}  # fmt: skip
NOT_OURS = {
    r"\binfos\b|\ban info\b": "info is a mass noun",
    r"\bturn(s|ed|ing)? round\b": "reverse the sign",
    r"\bc_?W\b": "the drag coefficient is c_d",
    r"\bcurved (model|transition|observation)": "nonlinear",
    r"\blog lacks\b": "say what is missing from the log, and what it has",
    r"\bpapers? 0\d\d\b": "a paper has a name, that of `jaxveh reproduce`",
}


def is_participle(word):
    return word not in NOUNS and (word in IRREGULAR or bool(re.fullmatch(r"[a-z]{2,}(ed|ing)", word)))


def is_bare(name):
    """Whether a name is a participle with no noun: `turned_back`, not `normalised_weights`."""
    words = name.split("_")
    return any(map(is_participle, words)) and all(is_participle(word) or word in PARTICLES for word in words)


def functions(node):
    """Functions of a module and methods of its classes, but none inside of a function."""
    for inside in ast.iter_child_nodes(node):
        if isinstance(inside, ast.FunctionDef):
            yield inside
        elif not isinstance(inside, ast.Lambda):
            yield from functions(inside)


def test_a_bare_participle_is_told_from_a_name():
    bare = ("turned_back", "seen", "told_when", "fading")
    good = ("normalised_weights", "propagate", "seed", "with_batch_shape", "is_calibrated")
    assert all(map(is_bare, bare)) and not any(map(is_bare, good))


@pytest.mark.parametrize("room", ROOMS)
def test_no_function_is_named_by_a_bare_participle(room):
    modules = [importlib.import_module(f"jaxveh.{room}")]
    if (ROOT / room / "kit.py").exists():
        modules.append(importlib.import_module(f"jaxveh.{room}.kit"))
    public = {name for one in modules for name in getattr(one, "__all__", ()) if inspect.isroutine(getattr(one, name))}
    public |= {
        function.name
        for path, tree in trees().items()
        if path.relative_to(ROOT).parts[0] == room
        for function in functions(tree)
        if not function.name.startswith("_")
    }
    assert not sorted(name for name in public if is_bare(name) and name not in EXEMPT)


def cells(path):
    """The text of a notebook's cells, without what they have shown."""
    return "\n".join("".join(cell["source"]) for cell in json.loads(path.read_text())["cells"])


def texts():
    for path in (*trees(), TOP / "README.md", TOP / "CONTRIBUTING.md", *PAGES):
        yield path, path.read_text()
    for path in (TOP / "notebooks").rglob("*.ipynb"):
        yield path, cells(path)


@pytest.mark.parametrize("words", NOT_OURS)
def test_words_that_the_glossary_replaces_stand_nowhere(words):
    found = [
        f"{path.relative_to(TOP)}: {line.strip()}"
        for path, text in texts()
        for line in text.splitlines()
        if re.search(words, line, re.IGNORECASE if "W" not in words else 0)
    ]
    assert not found, NOT_OURS[words]


AMERICAN = (
    "behavior|cent(er|ers|ered)|color(s|ed)?|optimiz(e|ed|es|ation)|maneuvers?|tires?|analyz(e|ed|es)|normaliz(e|ed|ation)"
    "|regulariz(e|ed)|lineariz(e|ed|ation)|initializ(e|ed)|minimiz(e|ed|es)|maximiz(e|ed|es)|label(ed|ing)|model(ed|ing)|catalogs?"
    "|gray|neighbors?|recogniz(e|ed)|summariz(e|ed)|vectoriz(e|ed)|discretiz(e|ed|ation)|travel(ed|ing)|cancel(ed|ing)"
)
TITLES = ("entropy-regularized", "optimization barrier", "unified tire model", "modeling using the t", "Optimization")
"""Titles of papers, and other libraries' words."""


def prose_of(path, text):
    """What is written for people: a page without its code, the docstrings of a module."""
    if path.suffix == ".ipynb":
        text = "\n".join(
            "".join(cell["source"]) for cell in json.loads(path.read_text())["cells"] if cell["cell_type"] == "markdown"
        )
    if path.suffix == ".py":
        tree = trees().get(path) or ast.parse(text)
        strings = [
            node.value.value
            for node in ast.walk(tree)
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        ]
        text = "\n".join(string for string in strings if isinstance(string, str))
    return re.sub(r"```.*?```|`[^`]*`", "", text, flags=re.DOTALL)


def test_english_is_spelt_as_in_british_journals():
    found = []
    for path, text in texts():
        prose = prose_of(path, text)
        for title in TITLES:
            prose = prose.replace(title, "")
        # Titles of books have capitals.
        found += [f"{path.relative_to(TOP)}: {word[0]}" for word in re.finditer(rf"\b({AMERICAN})\b", prose)]
    assert not found


def test_the_glossary_has_each_word_once():
    table = (TOP / "CONTRIBUTING.md").read_text().split("| word | what it is |")[1].split("\n\n")[0]
    words = [word.strip() for line in table.splitlines()[2:] for word in line.split("|")[1].split(",")]
    assert words and len(set(words)) == len(words)


@pytest.mark.parametrize("page", [TOP / "README.md", TOP / "CONTRIBUTING.md", *PAGES], ids=lambda page: page.stem)
def test_names_in_backticks_of_a_page_exist(page):
    prose = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
    names = re.findall(r"`([A-Za-z_][\w.]+)(?:\(|`)", prose)
    files = {path.name for path in TOP.iterdir()} | set(ELSEWHERE)
    assert not sorted(
        {name for name in names if not {name, name.split(".")[-1]} & files and not exists(name, everywhere())}
    )

"""Files spoilt at random, for tests that whatever a stranger's file holds ends in a finite object or an `InputError`."""

import random
import re
from collections.abc import Iterator

TOKENS = (
    "", " ", "NaN", "nan", "-NaN", "inf", "-inf", "Infinity", "1e400", "-1e400", "1e39", "-1e300", "1e-400", "0", "-0.0", "-1",
    "1", "1e30", "1_000", "1.2 1.2", "1,5", "1.5,2.5", "1.2.3", "1e", ".", "+", "--1", "1.0d3", "0x10", "1e5e5", "1.0 kg", "kg",
    "'kg'", '"kg"', "'", '"', "''", "'open", "'61'", "None", "null", "true", "~", "[1, 2]", "[]", "{}", "{a: 1}", "*a", "&a 1",
    "!!python/name:os.system", "1979-05-27", "12:30:45", "$", "!", "#", "%", "=", "= 3", ":", ";", "-", "[x]", "\t", "9" * 400,
    "-" + "9" * 40, "1" * 5000, "１２", "٣", "１.５", "²", "1\u00a0000", "é", "\ufeff", "\u2028", "\x1a", "x" * 3000, "../../etc",
    "[/]", "[bold]", "\udcb0",
)  # fmt: skip
"""What may stand where a value should."""

NUMBER = re.compile(rb"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?")
WORD = re.compile(rb"[A-Za-z_][\w.]*")
VALUE = re.compile(rb"(?<=[=:])[^\r\n]*")
ENCODINGS = ("utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-8-sig", "cp037")


def mutations(seed: int, originals: list[bytes], count: int) -> Iterator[bytes]:
    """`count` files, each one of the originals with one to four changes."""
    for k in range(count):
        rng = random.Random(f"{seed}/{k}")
        data = rng.choice(originals)
        for _ in range(rng.choice((1, 1, 1, 2, 3, 4))):
            data = rng.choice(CHANGES)(rng, data)
        yield data


def _token(rng: random.Random) -> bytes:
    return rng.choice(TOKENS).encode("utf-8", "surrogateescape")


def _instead(pattern: re.Pattern, rng: random.Random, data: bytes, new) -> bytes:
    """One match of the pattern replaced by `new(old)`."""
    found = list(pattern.finditer(data))
    if not found:
        return data
    at = rng.choice(found)
    return data[: at.start()] + new(at[0]) + data[at.end() :]


def _number(rng, data):
    return _instead(NUMBER, rng, data, lambda old: _token(rng))


def _value(rng, data):
    return _instead(VALUE, rng, data, lambda old: b" " + _token(rng))


def _words_swapped(rng, data):
    """A key, a unit or a section's name that is another's, or nobody's."""
    words = WORD.findall(data)
    if not words:
        return data
    news = (
        rng.choice(words),
        rng.choice(words).lower(),
        _token(rng),
        rng.choice(words) + b"X",
        b"1" + rng.choice(words),
    )
    return _instead(WORD, rng, data, lambda old: rng.choice(news))


def _lines(change):
    def changed(rng, data):
        lines = data.splitlines(keepends=True)
        if not lines:
            return data
        return b"".join(change(rng, lines, rng.randrange(len(lines)), rng.randrange(len(lines))))

    return changed


@_lines
def _dropped(rng, lines, i, j):
    return lines[:i] + lines[i + rng.choice((1, 1, 1, 5, 50)) :]


@_lines
def _doubled(rng, lines, i, j):
    return [*lines[:j], lines[i], *lines[j:]]


@_lines
def _swapped(rng, lines, i, j):
    lines[i], lines[j] = lines[j], lines[i]
    return lines


@_lines
def _joined(rng, lines, i, j):
    lines[i] = lines[i].rstrip(b"\r\n") + rng.choice((b"", b" ", b","))
    return lines


@_lines
def _cut(rng, lines, i, j):
    lines[i] = lines[i][: rng.randrange(len(lines[i]) + 1)]
    return lines


@_lines
def _indented(rng, lines, i, j):
    lines[i] = rng.choice((b" ", b"\t", b"    ", b"$", b"!", b"#", b",", b"\xc2\xa0")) + lines[i]
    return lines


def _flipped(rng, data):
    at = rng.randrange(max(len(data), 1))
    return data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]


def _inserted(rng, data):
    at = rng.randrange(len(data) + 1)
    return (
        data[:at]
        + rng.choice((b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\x80", b"\x1b[31m", b"\x0c", _token(rng)))
        + data[at:]
    )


def _removed(rng, data):
    at = rng.randrange(len(data) + 1)
    return data[:at] + data[at + rng.choice((1, 1, 2, 10, 100)) :]


def _ended(rng, data):
    return data[: rng.randrange(len(data) + 1)]


def _line_ends(rng, data):
    return data.replace(b"\r\n", b"\n").replace(b"\n", rng.choice((b"\r\n", b"\r", b"\n\r", b"\n\n", b"\x85", b"\x0b")))


def _encoded(rng, data):
    return data.decode("utf-8", "replace").encode(rng.choice(ENCODINGS), "replace")


def _marked(rng, data):
    return rng.choice((b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff", b"\0")) + data


CHANGES = (
    *(_number, _value, _words_swapped) * 4, *(_dropped, _doubled, _swapped) * 2, _joined, _cut, _indented, _flipped, _flipped,
    _inserted, _removed, _ended, _line_ends, _encoded, _marked,
)  # fmt: skip


def spoil(rng, data):
    """Bytes cut off, replaced, left out, doubled or turned over, near the front as often as anywhere."""
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = rng.randrange(rng.choice((len(data), min(len(data), 600))))
        size = rng.choice((1, 1, 1, 2, 4, 8, 64))
        change = rng.randrange(6)
        if change == 0:
            data = data[: max(at, 1)]
        elif change == 1:
            data = data[:at] + data[at + size :]
        elif change == 2:
            data = data[:at] + data[at : at + size] + data[at:]
        elif change == 3:
            data = data[:at] + bytes(rng.choice((0, 0xFF, 0x80, 0x7F)) for _ in range(size)) + data[at + size :]
        else:
            data = data[:at] + rng.randbytes(size) + data[at + size :]
    return data or b"\0"

"""What becomes of chunks that fail, hang, or lose their worker: with a crew that does as it is told."""

import random
from concurrent.futures import Future

import pytest

from jaxveh import InputError, JaxvehWarning
from jaxveh.sweeps import driving
from jaxveh.sweeps.chunks import ChunkError, Unfit

HANG, DEATH, LOST = "hang", RuntimeError("the worker is gone"), "cancelled"
BAD = ChunkError("ValueError: five is right out")


class Crew:
    """Chunks end as `told` says, try by try, and then well."""

    workers = 2

    def __init__(self, told):
        self.told = {number: list(ends) for number, ends in told.items()}
        self.tries, self.dropped, self.hanging, self.most = [], [], set(), 0

    def submit(self, number):
        self.tries.append(number)
        future, end = Future(), self.told[number].pop(0) if self.told.get(number) else None
        future.number = number
        if end == HANG:
            self.hanging.add(future)
            self.most = max(self.most, len(self.hanging))
        elif end == LOST:
            future.cancel()
            future.set_running_or_notify_cancel()
        elif isinstance(end, BaseException):
            future.set_exception(end)
        else:
            future.set_result(number)
        return future

    def drop(self, future):
        self.hanging.remove(future)
        self.dropped.append(future.number)

    def is_death(self, error):
        return error is DEATH


def driven(told, numbers=range(6), limit=0.01):
    crew, done, failed = Crew(told), [], {}
    driving.drive(crew, numbers, limit, done.append, failed.__setitem__)
    return crew, done, failed


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(driving, "POLL", 0.002)


def test_all_are_done_once_in_order():
    crew, done, failed = driven({})
    assert crew.tries == list(range(6)) and sorted(done) == list(range(6)) and not failed


def test_no_more_are_out_than_keep_all_workers_busy():
    crew, done, failed = driven({i: [HANG] for i in range(20)}, range(20))
    assert sorted(done) == sorted(crew.dropped) == list(range(20)) and not failed
    assert crew.most == driving.AHEAD * crew.workers


ENDS = {
    "fails twice": ([BAD, BAD], True, 3),
    "fails thrice": ([BAD, BAD, BAD], False, 3),
    "loses its worker often": (20 * [DEATH], True, 21),
    "loses its worker always": (1000 * [DEATH], False, driving.LOSSES),
    "is cancelled": ([LOST, LOST, LOST, LOST], True, 5),
    "hangs twice": ([HANG, HANG], True, 3),
    "hangs and fails": ([HANG, BAD, HANG], False, 3),
    "fails among deaths": ([DEATH, BAD, DEATH, DEATH, BAD, DEATH], True, 7),
}


@pytest.mark.parametrize("case", ENDS)
def test_a_chunk_that(case):
    ends, well, tries = ENDS[case]
    crew, done, failed = driven({3: ends})
    assert sorted(done) == [i for i in range(6) if well or i != 3] and list(failed) == ([] if well else [3])
    assert crew.tries.count(3) == tries and all(crew.tries.count(i) == 1 for i in range(6) if i != 3)
    assert crew.dropped == [3] * ends[:tries].count(HANG)
    if failed:
        last = {HANG: "took longer than 0.01 s"}.get(ends[tries - 1], str(ends[tries - 1]))
        assert failed[3] == last


@pytest.mark.parametrize(
    ("end", "message"),
    [
        (OSError(28, "No space left on device"), "cannot be written: .*No space left"),
        (Unfit("jax is '1' here"), "does not fit: jax"),
    ],
)
def test_what_no_other_try_mends_ends_it(end, message):
    with pytest.raises(InputError, match=message):
        driven({2: [end]})


def test_without_workers_it_waits_and_says_so_once():
    class Late(Crew):
        """Nobody is there until the 30th look."""

        looks = 0

        @property
        def workers(self):
            self.looks += 1
            if self.looks == 30:
                for future in [*self.hanging]:
                    self.hanging.remove(future)
                    future.set_result(future.number)
            return 0 if self.looks < 30 else 2

    crew, done, failed = Late({i: [HANG] for i in range(2)}), [], {}
    with pytest.warns(JaxvehWarning, match="no worker") as told:
        driving.drive(crew, range(4), 0.004, done.append, failed.__setitem__)
    assert len(told) == 1 and sorted(done) == [0, 1, 2, 3] and not failed and not crew.dropped


def test_whatever_happens_each_chunk_is_done_or_told():
    rng = random.Random(0)
    for _ in range(50):
        told = {i: rng.choices([BAD, DEATH, LOST, HANG, None], k=rng.randrange(6)) for i in range(12)}
        crew, done, failed = driven(told, range(12), limit=0.004)
        assert sorted([*done, *failed]) == list(range(12))
        assert not crew.hanging

"""The criteria as they were asked, and those that replace or repeat them."""

from __future__ import annotations

from typing import NamedTuple

from jaxveh.experiments.model_adaptive_pf.contestants import ADAPTIVE, CUBATURE, PLAIN, REDESIGNED, ROBUST, STUDENT
from jaxveh.experiments.report import Terms


class Question(NamedTuple):
    """A criterion of sideslip in a `case`: the contestant that was `asked` about and the one that was made `later`, compared
    with `other` by the ratio of medians or, with `loses`, by the share of seeds in which it loses; at most `bound`."""

    case: str
    asked: str
    later: str
    other: str
    bound: float
    loses: bool = False


QUESTIONS = (
    Question("both", ADAPTIVE, REDESIGNED, PLAIN, 0.78),
    Question("both", ADAPTIVE, REDESIGNED, CUBATURE, 0.4),
    Question("both", ADAPTIVE, REDESIGNED, PLAIN, 0.1, loses=True),
    Question("both", STUDENT, ROBUST, PLAIN, 0.72),
    Question("constant", ADAPTIVE, REDESIGNED, PLAIN, 1.03),
)

NOTHING, TOLD_LENGTH, WRONG_LENGTH = (
    "no relaxation known",
    "told the relaxation length",
    "told half or twice the length",
)
"""The information of all filters of a ratio about the true tyres' relaxation."""


class Asked(NamedTuple):
    """A question about one `contestant`; `knows`: what all filters in it are told of the relaxation length."""

    question: Question
    contestant: str
    knows: str

    @property
    def name(self) -> str:
        """The criterion's name."""
        case, *_, loses = self.question
        how = f"loses to {self.question.other}, share of seeds" if loses else f"over {self.question.other}"
        return f"{case}: {self.contestant} {how}; {self.knows}"


_DRIVES = (
    "medians of sideslip RMSE on the report's drives; filters are told steer, torques, each tyre's true stiffness and friction "
    "(their tyre law differs from the truth's) and the data sheet's noise"
)
_LATER = "; made after the asked one had missed 0.78 and 0.72; window, start and tails by likelihood on drives of a third key"
_KNOWS = {
    NOTHING: "; no filter is told of relaxation, as in the first run",
    TOLD_LENGTH: "; all filters are told the true length; added after the first run without it had missed",
    WRONG_LENGTH: "; all filters are told half or twice the true length: the worse of both",
}


def _check_question(question: Question) -> list[Asked]:
    """The question as it was asked, and those that replace or repeat it."""
    knows = (NOTHING, WRONG_LENGTH, TOLD_LENGTH)
    return [Asked(question, who, what) for who in (question.asked, question.later) for what in knows]


def _terms(one: Asked, first: Asked) -> Terms:
    later = _LATER if one.contestant == one.question.later else ""
    return Terms(_DRIVES + _KNOWS[one.knows] + later, "" if one == first else first.name)


ASKED = tuple(one for question in QUESTIONS for one in _check_question(question))

CRITERIA = {one.name: _terms(one, _check_question(one.question)[0]) for one in ASKED}
"""The criteria by name; those that replace or repeat another follow it."""

"""What every verdict says, of edges and of captures alike."""

from __future__ import annotations

import pytest

from servogen.verify import CaptureVerdict, Verdict
from servogen.verify.verdict import Judgement

WRONG, UNSEEN = "RB0 is late", "2 different frames were not seen"


@pytest.mark.parametrize(
    ("judgement", "word", "accepted", "accepted_partly"),
    [
        (Judgement(True, ()), "passed", True, True),
        (Judgement(False, (WRONG,)), "not passed", False, False),
        (Judgement(False, (UNSEEN,), unseen=(UNSEEN,)), "passed as far as it was seen", False, True),
        (Judgement(False, (WRONG, UNSEEN), unseen=(UNSEEN,)), "not passed", False, False),
    ],
)
def test_what_is_wrong_outweighs_what_was_not_seen(
    judgement: Judgement, word: str, accepted: bool, accepted_partly: bool
) -> None:
    assert judgement.word == word
    assert (judgement.accepted(False), judgement.accepted(True)) == (accepted, accepted_partly)


def test_a_run_is_exact_and_a_capture_agrees_and_neither_is_a_theorem() -> None:
    assert (Verdict.WORD, Verdict.NOT) == ("exact", "not exact")
    assert (CaptureVerdict.WORD, CaptureVerdict.NOT) == ("agrees", "does not agree")
    for kind in (Verdict, CaptureVerdict):
        assert not {"agrees", "word", "accepted"} & set(vars(kind))

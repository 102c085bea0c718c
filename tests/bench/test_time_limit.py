"""What hangs on the bench fails: the tests have a time limit, and so has what cleans up behind them."""

import signal
import threading
import time

import pytest

from tests.bench.conftest import MOST_S
from tests.time_limit import TooLong, time_limit


def test_every_test_here_runs_against_the_limit() -> None:
    left, again = signal.getitimer(signal.ITIMER_REAL)
    assert 0 < left <= MOST_S
    assert again > 0


def test_waiting_for_a_device_that_never_answers_ends() -> None:
    never = threading.Event()
    with pytest.raises(TooLong, match=r"longer than 0\.05 s"), time_limit(0.05):
        never.wait()


def test_code_that_handles_every_exception_of_its_own_does_not_handle_the_limit() -> None:
    with pytest.raises(TooLong), time_limit(0.05):
        while True:
            try:
                time.sleep(60)
            except Exception:
                continue


def test_what_ends_in_time_is_left_alone_and_the_alarm_is_as_it_was() -> None:
    before = signal.getsignal(signal.SIGALRM)
    with time_limit(60):
        pass
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    assert signal.getsignal(signal.SIGALRM) is before

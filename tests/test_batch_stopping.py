"""A batch ends when it is told to, also where the telling is lost on the way."""

import os
import signal

import pytest

from slamreplay.batch.stopping import Stopped, check_stopped, stoppable


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_at_once(number):
    with pytest.raises(Stopped) as caught, stoppable():
        os.kill(os.getpid(), number)

    assert caught.value.is_terminated == (number == signal.SIGTERM)
    check_stopped()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_signal_that_comes_within_a_finalizer_stops_at_the_next_look():
    class Signalled:
        def __del__(self):
            os.kill(os.getpid(), signal.SIGINT)
            for _ in range(1000):  # the handler runs before the finalizer ends
                pass

    went_on = []

    def work():
        Signalled()
        went_on.append(True)
        check_stopped()

    with pytest.raises(Stopped), stoppable():
        work()
    assert went_on


def test_a_second_signal_does_not_disturb_the_tidying_up():
    tidy = []

    def work():
        try:
            os.kill(os.getpid(), signal.SIGINT)
        finally:
            os.kill(os.getpid(), signal.SIGTERM)
            tidy.append(True)

    with pytest.raises(Stopped), stoppable():
        work()
    assert tidy


def test_afterwards_signals_mean_what_they_did():
    before = signal.getsignal(signal.SIGINT)
    with stoppable():
        assert signal.getsignal(signal.SIGINT) is not before

    assert signal.getsignal(signal.SIGINT) is before

"""What costs time is done at a bounded rate."""

from app.training.worker.cadence import Cadence


def test_the_first_is_due_one_interval_after_the_first_question():
    cadence = Cadence(2.0)
    assert [cadence.is_due(now_s) for now_s in (10.0, 11.9, 12.0)] == [False, False, True]


def test_a_slow_one_is_done_less_often():
    cadence = Cadence(2.0, max_share=0.1)
    cadence.is_due(0.0)
    cadence.done(10.0, 10.1)
    assert not cadence.is_due(11.9)
    assert cadence.is_due(12.0)
    cadence.done(20.0, 21.0)  # a second at a tenth of the time
    assert not cadence.is_due(29.9)
    assert cadence.is_due(30.0)

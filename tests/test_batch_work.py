"""Which task goes out next, and whom a dead worker died of."""

from hypothesis import given
from hypothesis import strategies as st

from slamreplay.batch.task import LogSource, LogTask
from slamreplay.batch.work import DEATHS, PER_WORKER, Work


def tasks(count):
    return [LogTask(f"{k:032x}", LogSource(f"{k}.mcap", ())) for k in range(count)]


def sent(work, threads):
    out = []
    while (task := work.next(threads)) is not None:
        out.append(task.key)
    return out


def test_few_tasks_are_out_at_once():
    work = Work(tasks(10))

    assert len(sent(work, 2)) == 2 * PER_WORKER
    assert sent(work, 2) == []


def test_who_waited_behind_a_killer_is_not_taken_for_one():
    work = Work(tasks(2))
    killer, other = sent(work, 1)

    assert not work.died(killer)
    assert not work.died(other)
    assert sent(work, 1) == [killer]  # with nothing beside it
    assert not work.died(killer)
    assert sent(work, 1) == [other]
    work.done(other)
    assert sent(work, 1) == [killer]
    assert work.died(killer)
    assert work.deaths[killer] == DEATHS
    assert not work.left


def test_many_deaths_in_company_do_not_condemn():
    work = Work(tasks(1))
    (key,) = sent(work, 1)

    assert not work.died(key, 4)  # as often as dask tries by default
    assert sent(work, 1) == [key]
    assert work.died(key)


def test_a_suspect_that_is_given_back_goes_out_alone_again():
    work = Work(tasks(2))
    killer, other = sent(work, 1)
    work.died(killer)
    work.died(other)
    assert sent(work, 1) == [killer]

    work.give_back()
    assert sent(work, 1) == [killer]
    assert not work.died(killer)
    assert sent(work, 1) == [other]
    work.done(other)
    assert sent(work, 1) == [killer]
    assert work.died(killer)


def test_suspects_wait_for_the_others():
    work = Work(tasks(3))
    first, second = sent(work, 1)
    work.died(first)

    assert sent(work, 1) == [f"{2:032x}"]
    work.done(second)
    assert sent(work, 1) == []


def test_what_a_lost_scheduler_had_goes_out_again_first():
    work = Work(tasks(6))
    before = sent(work, 1)

    work.give_back()

    assert sent(work, 1) == before


@given(
    count=st.integers(1, 8),
    threads=st.integers(1, 3),
    killers=st.sets(st.integers(0, 7)),
    losses=st.integers(0, 3),
    chance=st.randoms(use_true_random=False),
)
def test_every_task_ends_once_whatever_dies(count, threads, killers, losses, chance):
    """Killers fail, all others are done: a model of a cluster whose workers hold several tasks."""
    work = Work(tasks(count))
    killers = {f"{k:032x}" for k in killers}
    out, ended = [], []
    for _ in range(500):
        out += sent(work, threads)
        if not work.left:
            break
        key = out.pop(chance.randrange(len(out)))
        if losses and chance.random() < 0.2:
            losses -= 1
            work.give_back()
            out = []
        elif key in killers:
            beside = out[: chance.randint(0, len(out))]
            out = out[len(beside) :]
            ended += [(k, "failed") for k in [key, *beside] if work.died(k)]
        else:
            work.done(key)
            ended.append((key, "done"))

    every = {t.key for t in tasks(count)}
    assert sorted(ended) == sorted((k, "failed" if k in killers else "done") for k in every)

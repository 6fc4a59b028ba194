"""What the end of a task says about its log, and what about the scheduler."""

from queue import SimpleQueue
from types import SimpleNamespace

import pytest

from slamreplay.batch.loop import _fetch, _LostError


@pytest.mark.parametrize(
    ("status", "error", "kind"),
    [
        ("error", OSError("the disk of a worker is full"), OSError),
        ("lost", OSError("nobody answers"), _LostError),
        ("pending", TimeoutError(), _LostError),
        ("finished", ValueError("a result that cannot be unpacked"), ValueError),
    ],
)
def test_only_what_no_task_raised_is_taken_for_a_lost_scheduler(status, error, kind):
    async def gather(_futures, *, asynchronous):
        raise error

    ended, future = SimpleQueue(), SimpleNamespace(status=status)
    fetching = _fetch(SimpleNamespace(gather=gather), future, ended)
    with pytest.raises(StopIteration):
        fetching.send(
            None
        )  # waits for nothing; a loop may run in this thread, of a browser's tests

    of, came = ended.get_nowait()
    assert of is future
    assert type(came) is kind

# SPDX-License-Identifier: GPL-3.0-or-later
"""One queue for the work of all parts of `make test`: as many pieces at a time as there are processors,
the heaviest that waits first, so that none is idle while another part still has pieces.

A piece must not wait for another one: a part hands in its pieces from a thread of its own and waits there.
"""

import concurrent.futures
import heapq
import itertools
import os
import threading


class WorkQueue:
    def __init__(self, workers):
        self._workers = workers
        self._started = 0
        self._waiting = []
        self._order = itertools.count()  # of the same weight the first that came
        self._changed = threading.Condition()

    def submit(self, weight, function, *arguments, **options):
        """A future of `function(…)`; `weight`: about how many seconds it takes."""
        future = concurrent.futures.Future()
        with self._changed:
            piece = (future, function, arguments, options)
            heapq.heappush(self._waiting, (-weight, next(self._order), piece))
            if self._started < self._workers:
                self._started += 1
                threading.Thread(target=self._work, daemon=True).start()
            self._changed.notify()
        return future

    def map(self, weight, function, items):
        """What `function` returns for each item, in their order, once all are done."""
        futures = [self.submit(weight, function, item) for item in items]
        return [future.result() for future in futures]

    def _work(self):
        while True:
            with self._changed:
                while not self._waiting:
                    self._changed.wait()
                _, _, (future, function, arguments, options) = heapq.heappop(self._waiting)
            try:
                future.set_result(function(*arguments, **options))
            except BaseException as error:
                future.set_exception(error)


QUEUE = WorkQueue(len(os.sched_getaffinity(0)) or 1)

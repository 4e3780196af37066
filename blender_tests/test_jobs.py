# SPDX-License-Identifier: GPL-3.0-or-later
"""The state machine of jobs, with a backend that does nothing and a clock that we turn."""

import threading
import unittest

from matterfit import jobs
from matterfit.jobs import Job, JobError, Outcome, Snapshot, State, ThreadRun


class FakeBackend:
    def __init__(self, steps=4, status=0, error=""):
        self.steps = steps
        self.step = 0
        self.status = status
        self.error = error
        self.cancelled = False
        self.freed = 0

    def poll(self):
        if not self.cancelled and self.step < self.steps:
            self.step += 1
        finished = self.cancelled or self.step >= self.steps
        return Snapshot(finished=finished, fraction=self.step / self.steps, frame=self.step)

    def cancel(self):
        self.cancelled = True

    def wait(self):
        self.step = self.steps

    def outcome(self):
        if self.cancelled:
            return Outcome(jobs.EXIT_CANCELLED, {}, "cancelled")
        return Outcome(self.status, {"ok": True}, self.error)

    def free(self):
        self.freed += 1


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


class JobTest(unittest.TestCase):
    def job(self, backend, clock=None):
        return Job("test", lambda: backend, clock=clock or Clock())

    def test_runs_to_done_and_frees_once(self):
        """A blocking run polls until the end and hands over the result."""
        backend = FakeBackend()
        ticks = []
        job = self.job(backend).run(on_tick=lambda j: ticks.append(j.snapshot.frame), interval=0.0)
        self.assertIs(job.state, State.DONE)
        self.assertEqual(job.result, {"ok": True})
        self.assertEqual(ticks, [1, 2, 3, 4])
        self.assertEqual(backend.freed, 1)
        self.assertFalse(job.tick(), "a finished job must not poll a freed backend")
        job.cancel()
        self.assertIs(job.state, State.DONE)

    def test_cancel(self):
        """Cancel goes through CANCELLING, and the next poll ends it."""
        backend = FakeBackend()
        job = self.job(backend).start()
        job.tick()
        job.cancel()
        self.assertIs(job.state, State.CANCELLING)
        job.cancel()
        self.assertTrue(job.tick())
        self.assertIs(job.state, State.CANCELLED)
        self.assertEqual(job.status, 130)
        self.assertEqual(backend.freed, 1)

    def test_failure_keeps_status_and_message(self):
        job = self.job(FakeBackend(status=3, error="particle 7 left")).run(interval=0.0)
        self.assertIs(job.state, State.FAILED)
        self.assertEqual((job.status, job.error), (3, "particle 7 left"))

    def test_start_that_raises(self):
        """A document that is refused never has a backend."""
        def start():
            raise JobError("scene.frames is empty", 2)

        job = Job("test", start).run(interval=0.0)
        self.assertIs(job.state, State.FAILED)
        self.assertEqual((job.status, job.error), (2, "scene.frames is empty"))
        with self.assertRaises(RuntimeError):
            job.start()

    def test_on_end(self):
        """Called once at each kind of end, with the state that the job has ended in."""
        def refuse():
            raise JobError("no")

        for start, expected in ((FakeBackend, State.DONE), (refuse, State.FAILED),
                                (lambda: FakeBackend(status=2), State.FAILED)):
            seen = []

            def on_end(job, seen=seen):
                seen.append(job.state)

            Job("test", start, on_end=on_end).run(interval=0.0)
            self.assertEqual(seen, [expected])

    def test_time_left_counts_from_what_was_seen_first(self):
        """A resumed run stands at 50 % at once; its rate must not count that half."""
        clock = Clock()
        backend = FakeBackend(steps=10)
        backend.step = 4
        job = self.job(backend, clock).start()
        self.assertIsNone(job.seconds_left)
        job.tick()  # .5 at 100 s
        clock.now += 20.0
        job.tick()  # .6 at 120 s: .1 in 20 s
        self.assertAlmostEqual(job.seconds_left, 80.0)
        self.assertAlmostEqual(job.elapsed, 20.0)

    def test_registry_stops_all(self):
        registry = jobs.Registry()
        first, second = FakeBackend(steps=99), FakeBackend(steps=99)
        running = registry.add(self.job(first).start())
        also = registry.add(self.job(second).start())
        self.assertIs(registry.running, also)
        registry.stop_all()
        self.assertIs(running.state, State.CANCELLED)
        self.assertIs(also.state, State.CANCELLED)
        self.assertEqual((first.freed, second.freed), (1, 1))
        self.assertIsNone(registry.current)

    def test_texts(self):
        self.assertEqual(jobs.duration_text(0.2), "< 1 s")
        self.assertEqual(jobs.duration_text(3.4), "3 s")
        self.assertEqual(jobs.duration_text(125), "2 min 5 s")
        self.assertEqual(jobs.duration_text(3840), "1 h 4 min")
        self.assertEqual(jobs.duration_text(None), "")
        self.assertEqual(jobs.size_text(512), "512 B")
        self.assertEqual(jobs.size_text(1000), "1.0 kB")
        self.assertEqual(jobs.size_text(8.0 * 1e9), "8.0 GB", "Memory Limit counts so")
        self.assertEqual(jobs.size_text(2 * 1000**4), "2000.0 GB")


class ThreadRunTest(unittest.TestCase):
    def job(self, function):
        return Job("call", lambda: ThreadRun(function, "Reading"))

    def test_result(self):
        job = self.job(lambda: {"faults": []}).run(interval=0.001)
        self.assertIs(job.state, State.DONE)
        self.assertEqual(job.result, {"faults": []})
        self.assertEqual(job.snapshot.stage, "Reading")

    def test_errors(self):
        """A refusal keeps its status; whatever else is raised is a computation that failed."""
        for error, status, message in ((JobError("no manifest", 2), 2, "no manifest"),
                                       (ValueError("odd"), 3, "ValueError: odd")):
            def fail(error=error):
                raise error

            job = self.job(fail).run(interval=0.001)
            self.assertIs(job.state, State.FAILED)
            self.assertEqual((job.status, job.error), (status, message))

    def test_cancel_does_not_wait(self):
        """A call that hangs is left behind, by Cancel and by stop_all."""
        gate = threading.Event()
        self.addCleanup(gate.set)
        registry = jobs.Registry()
        first = registry.add(self.job(gate.wait).start())
        self.assertFalse(first.tick() and first.ended)
        first.cancel()
        first.tick()
        self.assertIs(first.state, State.CANCELLED)
        second = registry.add(self.job(gate.wait).start())
        registry.stop_all()
        self.assertIs(second.state, State.CANCELLED)
        self.assertFalse(gate.is_set())


class Part:
    """A backend that ends when it is told."""

    def __init__(self, status=jobs.EXIT_DONE, result=None):
        self.status, self.result = status, result or {}
        self.done = self.freed = False

    def poll(self):
        return jobs.Snapshot(finished=self.done, fraction=0.5, stage="part")

    def cancel(self):
        self.status, self.done = jobs.EXIT_CANCELLED, True

    def wait(self):
        self.done = True

    def outcome(self):
        return jobs.Outcome(self.status, self.result, "" if self.status == 0 else "why")

    def free(self):
        self.freed = True


class ThenRunTest(unittest.TestCase):
    def setUp(self):
        self.first, self.second = Part(result={"n": 1}), Part(result={"n": 2})
        self.seen = []

    def job(self, go_on=None):
        def second(outcome):
            self.seen.append(outcome.result)
            return self.second

        return Job("two", lambda: jobs.ThenRun(self.first, go_on or second)).start()

    def test_one_after_the_other(self):
        job = self.job()
        job.tick()
        self.assertEqual(job.fraction, 0.0)
        self.first.done = True
        job.tick()
        self.assertEqual((job.state, self.seen), (State.RUNNING, [{"n": 1}]))
        job.tick()
        self.assertAlmostEqual(job.fraction, 0.5)
        self.second.done = True
        job.tick()
        self.assertEqual((job.state, job.result), (State.DONE, {"n": 2}))
        self.assertTrue(self.first.freed and self.second.freed)

    def test_cancel_in_the_first_begins_no_second(self):
        job = self.job()
        job.cancel()
        job.tick()
        self.assertEqual((job.state, self.seen), (State.CANCELLED, []))

    def test_cancel_as_the_first_ends(self):
        """It has ended by itself before it heard of Cancel."""
        self.first.cancel = lambda: None
        self.first.done = True
        job = self.job()
        job.cancel()
        job.tick()
        self.assertEqual((job.state, self.seen), (State.CANCELLED, []))

    def test_cancel_in_the_second(self):
        job = self.job()
        self.first.done = True
        job.tick()
        job.cancel()
        job.tick()
        self.assertIs(job.state, State.CANCELLED)

    def test_join(self):
        self.assertEqual(self.job().join().result, {"n": 2})

    def test_what_does_not_go_on(self):
        self.first.status = 2
        job = self.job(lambda outcome: None).join()
        self.assertEqual((job.state, job.status, job.error), (State.FAILED, 2, "why"))

        for error, status, message in ((JobError("too large", 2), 2, "too large"),
                                       (ValueError("odd"), 3, "ValueError: odd")):
            def refuse(_outcome, error=error):
                raise error

            self.first = Part()
            job = self.job(refuse).join()
            self.assertEqual((job.state, job.status, job.error), (State.FAILED, status, message))

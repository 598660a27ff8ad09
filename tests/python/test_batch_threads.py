"""Threads and processes around a batch: its own, those of Python, forks and interrupts."""

from __future__ import annotations

import gc
import os
import signal
import threading
import time
import weakref

import pytest

import stickslip as ss
from batch_scenes import anymal, scattered, scattered_states


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="counts threads as Linux lists them")
def test_dropped_batches_take_their_threads_along() -> None:
    def drop() -> None:
        ss.Batch(anymal(), 64, num_threads=3).step()
        gc.collect()

    drop()
    before = len(os.listdir("/proc/self/task"))
    for _ in range(3):
        drop()
    assert len(os.listdir("/proc/self/task")) == before
    assert not [thing for thing in gc.get_objects() if type(thing) is ss.Batch]


def test_other_python_threads_run_during_a_step() -> None:
    batch = scattered(256, "float64", 1)
    ticks, done = [], threading.Event()

    def tick() -> None:
        while not done.wait(1e-3):
            ticks.append(time.perf_counter())

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.perf_counter()
    batch.step(1000)
    end = time.perf_counter()
    done.set()
    thread.join()
    during = [t for t in ticks if start < t < end - 1e-3]
    assert len(during) > 3, f"{len(during)} ticks in {end - start:.3f} s"


def test_two_threads_on_one_batch_are_told() -> None:
    batch = ss.Batch(anymal(), 64, num_threads=2)
    errors: list[str] = []

    def work() -> None:
        for _ in range(20):
            try:
                batch.step(20)
            except ValueError as error:
                errors.append(str(error))

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert not any(thread.is_alive() for thread in threads)
    assert errors and all("another thread is at work on this batch" in error for error in errors)


def test_first_use_of_a_parameter_during_a_step_is_told() -> None:
    batch = ss.Batch(anymal(), 64, num_threads=1)
    stepping = threading.Thread(target=batch.step, args=(100000,))
    stepping.start()
    until = time.monotonic() + 60
    while not batch.time[0] > 0 and time.monotonic() < until:  # written every few thousand steps
        time.sleep(1e-3)
    for name in ("body_mass", "kp", "generalized_force", "external_wrench"):
        with pytest.raises(ValueError, match="another thread is at work on this batch"):
            getattr(batch, name)
    assert batch.q.shape == (64, 19)  # which is there already
    assert stepping.is_alive()
    stepping.join(120)
    assert batch.body_mass.min() > 0 and not batch.generalized_force.any()


def test_interrupt_ends_a_long_call(ball: ss.Model) -> None:
    world = ss.World()
    world.add_robot(ball)
    batch = ss.Batch(world, 1, num_threads=1)
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        with pytest.raises(KeyboardInterrupt):
            batch.step(2**31 - 1)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
    assert 0 < batch.time[0] < 1e5
    assert batch.step() == ss.StepStatus.OK


def test_forked_process_steps_on_with_the_same_bits_and_can_let_go_of_the_batch() -> None:
    batch = ss.Batch(anymal(), 40, "float64", num_threads=2)
    batch.reset(None, *scattered_states(40))
    batch.step(5)
    start = batch.save_state()
    batch.step(5)
    expected = batch.q.tobytes()
    batch.load_state(start)
    time.sleep(0.01)  # the batch's thread sleeps now
    read, write = os.pipe()
    child = os.fork()
    if child == 0:  # nothing of pytest may run here
        try:
            signal.alarm(60)
            batch.step(5)
            same = batch.q.tobytes() == expected
            gone = weakref.ref(batch)
            del batch
            gc.collect()
            os.write(write, b"1" if same and gone() is None else b"0")
        finally:
            os._exit(0)
    os.close(write)
    os.waitpid(child, 0)
    assert os.read(read, 1) == b"1"
    os.close(read)

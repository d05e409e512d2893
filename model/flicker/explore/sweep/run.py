"""Runs the points of a sweep on Dask.

The points of one view are one task, so that a view is loaded and its reference rendered once. A worker reports every finished point at
once (a Dask event); this process writes it to disk. When a worker is lost, what it had not reported is submitted again.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import queue
import signal
import threading
import uuid
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from ...errors import FlickerError
from ..digest import code_digest
from ..points import Point, Target
from ..store import plain
from .config import Sweep
from .results import Rows

CONNECT_SECONDS = 5
MAX_LOST = 3  # workers lost by one view's task without a finished point


@dataclass
class SweepResult:
    """rows: of all points, in the order of the sweep. resumed: points that were there already. lost: tasks that lost their worker."""

    rows: list[dict[str, Any]]
    resumed: int
    computed: int
    lost: int


def _compute(points: list[Point], topic: str, share: int) -> list[tuple[str, dict[str, Any]]]:
    """On a worker: rows of the points of one view, each reported when it is finished. share: workers that divide the machine's cores."""
    import numba
    from distributed import get_worker

    from ..along import evaluate_along
    from ..evaluate import evaluate

    numba.set_num_threads(max(1, numba.config.NUMBA_NUM_THREADS // share))  # type: ignore[attr-defined]
    worker = get_worker()
    target, keys, rows = points[0].target, {point.configuration: point.key for point in points}, []
    if target.path is not None:
        found = evaluate_along(target, list(keys))
    else:
        view = target.load()
        found = ((name, evaluate(view, name).row) for name in keys)
    for name, values in found:
        row = {column: plain(value) if hasattr(value, "dtype") else value for column, value in values.items()}
        worker.log_event(topic, {"key": keys[name], "row": row, "pid": os.getpid()})
        rows.append((keys[name], row))
    return rows


def _missing_files(paths: list[str]) -> list[str]:
    """On a worker: files that it cannot see."""
    return [path for path in paths if not os.path.exists(path)]


def _quiet() -> None:
    for name in ("distributed", "distributed.nanny", "distributed.worker", "distributed.scheduler", "distributed.core", "distributed.comm"):
        logging.getLogger(name).setLevel(logging.CRITICAL)


@contextlib.contextmanager
def _without_ctrl_c() -> Iterator[None]:
    """Processes that begin here never see the terminal's Ctrl-C, which would print their tracebacks: it is this process that stops the workers."""
    if threading.current_thread() is not threading.main_thread():  # signals are not its business
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def connect(sweep: Sweep) -> Iterator:
    """A client of the sweep's cluster: the given address, else processes of this machine. FlickerError when it cannot be reached."""
    import dask
    from distributed import Client, LocalCluster

    _quiet()
    if sweep.address is not None:
        try:
            client = Client(sweep.address, timeout=CONNECT_SECONDS)
        except (Exception, asyncio.CancelledError) as error:  # of many kinds, by protocol and by how the connection ends
            raise FlickerError(f"cluster {sweep.address}: cannot be reached ({' '.join(str(error).split())[:120] or type(error).__name__})") from None
        with client:
            yield client
        return
    workers = sweep.workers or min(2, os.cpu_count() or 1)
    # A lost worker's task comes back to this process at once, which knows what is finished.
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        with contextlib.ExitStack() as stack:
            with _without_ctrl_c():
                cluster = stack.enter_context(LocalCluster(
                    n_workers=workers, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0",  # any free port
                    memory_limit=0, silence_logs=logging.CRITICAL,
                ))
                client = stack.enter_context(Client(cluster))
            yield client


def check_workers(client, sweep: Sweep) -> None:
    """Every worker must be able to do the work: there is one, it runs this code and sees the scenes."""
    try:
        client.wait_for_workers(1, timeout=CONNECT_SECONDS)
    except OSError:
        raise FlickerError(f"cluster {sweep.address}: has no workers") from None
    if sweep.address is None:
        return
    files = {str(path) for t in sweep.targets for path in (t.scene.path, t.scene.cameras_file, t.photo) if path is not None}
    paths = sorted(path for path in files if os.path.exists(path))
    try:
        codes = client.run(code_digest)
        missing = client.run(_missing_files, paths)
    except Exception as error:  # whatever the other side answers
        raise FlickerError(f"cluster {sweep.address}: workers cannot run flicker ({' '.join(str(error).split())[:120]})") from None
    for worker, code in codes.items():
        if code != code_digest():
            raise FlickerError(f"cluster {sweep.address}: worker {worker} runs other flicker code than this process")
    for worker, files in missing.items():
        if files:
            raise FlickerError(f"cluster {sweep.address}: worker {worker} cannot see {files[0]}")


def run_sweep(
    sweep: Sweep, *, client=None, on_point: Callable[[int, int, dict[str, Any]], None] | None = None,
) -> SweepResult:
    """Run what is missing; results are in `sweep.folder`.

    client: of a Dask cluster to be used instead of the sweep's own. on_point: called with (finished, total, event) at every finished
    point, first with an empty event for what was there; an event has the worker's process in `pid`, the row in `row`.
    FlickerError for bad input, before any work starts; for views that failed, after the others are done.
    """
    store = Rows(sweep)
    total, resumed = len(sweep.points), len(store.rows)
    report = on_point or (lambda done, total, event: None)
    report(resumed, total, {})
    lost = 0
    if store.missing():
        with contextlib.ExitStack() as stack:
            if client is None:
                client = stack.enter_context(connect(sweep))
            check_workers(client, sweep)
            lost = _run(client, sweep, store, lambda event: report(len(store.rows), total, event))
    store.complete()
    return SweepResult(store.ordered(), resumed, total - resumed, lost)


def _run(client, sweep: Sweep, store: Rows, report: Callable[[dict[str, Any]], None]) -> int:
    """Submit every view, take events until all are done; returns how often a worker was lost."""
    from distributed.scheduler import KilledWorker

    events: queue.Queue = queue.Queue()
    topic = f"flicker-sweep-{uuid.uuid4().hex}"
    points = {p.key: p for p in sweep.points}
    groups: dict[Target, list[Point]] = {}
    for point in store.missing():
        groups.setdefault(point.target, []).append(point)
    futures: dict[str, tuple] = {}
    attempts: dict[Target, tuple[int, int]] = {}  # points left at the last submission, workers lost since one was finished
    failures: list[str] = []
    lost = 0
    hosts = [worker["host"] for worker in client.scheduler_info(n_workers=-1)["workers"].values()]
    share = max(hosts.count(host) for host in hosts)

    def submit(view: Target) -> None:
        left = [p for p in groups[view] if p.key not in store.rows]
        before, tries = attempts.get(view, (len(left) + 1, 0))
        attempts[view] = (len(left), 0 if len(left) < before else tries + 1)
        future = client.submit(_compute, left, topic, share, pure=False, key=f"{topic}-{uuid.uuid4().hex}")
        futures[future.key] = (future, view)
        future.add_done_callback(lambda f: events.put(("done", f.key)))

    def keep(key: str, row: dict[str, Any], pid: int | None) -> None:
        if store.add(points[key], row):
            report({"key": key, "row": row, "pid": pid})

    client.subscribe_topic(topic, lambda event: events.put(("point", event[1])))
    try:
        for view in groups:
            submit(view)
        while futures:
            kind, value = events.get()
            if kind == "point":
                keep(value["key"], value["row"], value["pid"])
                continue
            future, view = futures.pop(value)
            try:
                for key, row in future.result():
                    keep(key, row, None)
            except KilledWorker:
                lost += 1
                _drain(events, keep)
                if attempts[view][1] >= MAX_LOST:
                    failures.append(f"{view.scene.path} view {view.number}: lost {MAX_LOST + 1} workers without finishing a point")
                elif any(p.key not in store.rows for p in groups[view]):
                    submit(view)
            except FlickerError as error:
                failures.append(f"{view.scene.path} view {view.number}: {error}")
            except Exception as error:  # one view's failure must not take the others' results
                if client.status != "running":
                    raise FlickerError(f"cluster {sweep.address or 'of this machine'}: connection lost") from None
                failures.append(f"{view.scene.path} view {view.number}: {type(error).__name__}: {error}")
    finally:
        with contextlib.suppress(Exception):
            client.cancel([future for future, _ in futures.values()], force=True)
            client.unsubscribe_topic(topic)
        _drain(events, keep)
    if failures:
        raise FlickerError(f"{len(failures)} of {len(groups)} views failed; {'; '.join(failures[:3])}")
    return lost


def _drain(events: queue.Queue, keep: Callable[[str, dict[str, Any], int | None], None]) -> None:
    """Keep the points already reported; what else is there stays for the loop."""
    others = []
    while True:
        try:
            kind, value = events.get_nowait()
        except queue.Empty:
            break
        if kind == "point":
            keep(value["key"], value["row"], value["pid"])
        else:
            others.append((kind, value))
    for other in others:
        events.put(other)

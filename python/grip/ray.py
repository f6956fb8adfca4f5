"""GRIP on Ray: the units of a campaign, and searches that choose their next point by what came of those before.

    ray.init()                                                   # or address="auto", on a cluster
    grip.campaign.plan("packing.toml", out="/shared/packing")
    grip.ray.run("/shared/packing")
    grip.campaign.merge("/shared/packing", out="/shared/packing-all")

Workers need this package, and see the same folders. A worker may be killed at any time: its unit or point is run again, on another one.
"""

from __future__ import annotations

import itertools
import json
import logging
import math
import os
import time
from typing import Any, Callable, Optional

try:
    import ray
except ImportError as error:
    raise ImportError("grip.ray needs Ray: pip install ray") from error

from . import _run, campaign
from ._grip import Error
from .campaign import TryAgain
from .verbs import Path

__all__ = ["adaptive", "run"]

log = logging.getLogger("grip")

# Nothing is ever cancelled: Ray ends the driver itself where a task is cancelled in the moment in which its result arrives (its issue
# 54260; once in a thousand times, with tasks of 50 ms). So Ray is given few tasks at a time, and those run out.
AHEAD = 2
"""Units that Ray knows of at a time, for each that the cluster can run now: the rest shows a cluster that grows that it should."""
MOST_IN_FLIGHT = 10_000
"""Of them altogether, so that millions are no burden."""
SLOTS_HOLD_S = 5.0
"""After which the size of the cluster is asked for again."""
PAUSE_S = 2.0
"""Before what can be done another time is tried again."""
SCHEMA = "grip.ray.adaptive/1"


def _unit(folder: str, number: int, jobs: int) -> None:
    # Ray gives a worker so many processors by word alone.
    os.environ.setdefault("RAYON_NUM_THREADS", str(jobs))
    campaign.run(folder, unit=number, jobs=jobs, progress=False)


def _task(function: Callable[..., Any], *arguments: Any) -> Any:
    try:
        return function(*arguments)
    except TryAgain:
        time.sleep(PAUSE_S)
        raise


def _remote(num_cpus: float, max_retries: int) -> Any:
    options: dict[str, Any] = {"num_cpus": num_cpus, "max_retries": max_retries, "retry_exceptions": [TryAgain]}
    return ray.remote(**options)(_task)


class _Slots:
    """How many tasks the cluster, as it is now, can run at a time."""

    def __init__(self, num_cpus: float) -> None:
        self.num_cpus, self.count, self.asked = num_cpus, 1, -math.inf

    def __call__(self) -> int:
        # Clusters grow and shrink, but not with every unit.
        if time.monotonic() - self.asked > SLOTS_HOLD_S:
            self.count = max(1, int(ray.cluster_resources().get("CPU", 0) / self.num_cpus)) if self.num_cpus > 0 else MOST_IN_FLIGHT
            self.asked = time.monotonic()
        return self.count


def run(campaign_folder: Path, *, max_retries: int = 20, num_cpus: float = 1, progress: Optional[bool] = None) -> dict[str, Any]:
    """Runs the missing units of a campaign, a task a unit.

    At Ctrl-C no more are begun: those that Ray has, two for each that the cluster can run, run to their end, or end with Ray, with the driver
    or by :func:`ray.shutdown`. What is finished of the units is kept in either case.

    Args:
        campaign_folder: Folder of the campaign, which all workers see by the same name.
        max_retries: How often a unit is tried again whose worker was killed, or that could be done another time (a full disk, another
            process that runs it).
        num_cpus: Processors of a task: so many results of a unit are made at the same time.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Returns:
        As :func:`grip.campaign.status`: a unit that was tried too often is still ``missing``, one that cannot be done is ``failed``.

    Raises:
        Error: When the campaign is wrong, such as inputs that are not what they were when it was planned. Nothing is tried again then.
    """
    folder = os.path.abspath(campaign_folder)
    missing = campaign.missing(folder)
    left = iter(missing)
    flight: dict[Any, int] = {}
    task, jobs, slots = _remote(num_cpus, max_retries), max(1, int(num_cpus)), _Slots(num_cpus)
    bars = _run.Progress(progress)
    bar = bars("units") if bars.tqdm else None
    if bar:
        bar.begin(len(missing), 0)
    try:
        while True:
            for number in itertools.islice(left, max(0, min(MOST_IN_FLIGHT, AHEAD * slots()) - len(flight))):
                flight[task.options(name=f"grip unit {number}").remote(_unit, folder, number, jobs)] = number
            if not flight:
                return campaign.status(folder)
            # As one ends, those that have ended too: to wait costs by how many are waited for.
            ray.wait(list(flight))
            for ended in ray.wait(list(flight), num_returns=len(flight), timeout=0)[0]:
                number = flight.pop(ended)
                try:
                    ray.get(ended)
                except ray.exceptions.RayTaskError as error:
                    if not isinstance(error.cause, TryAgain):
                        raise error.cause from None
                    log.warning("unit %d: tried %d times: %s", number, max_retries + 1, error.cause)
                except ray.exceptions.RayError as error:
                    log.warning("unit %d: tried %d times: %s", number, max_retries + 1, error)
                if bar:
                    bar.advance(1)
    finally:
        bars.close()


class _Journal:
    """Points and results on disk, a line each, in the order in which they came."""

    def __init__(self, path: Path, **about: Any) -> None:
        self.path = os.fspath(path)
        self.points: dict[int, Any] = {}
        self.results: dict[int, Any] = {}
        self.file = open(path, "a+b")
        self._alone()
        self.file.seek(0)
        text = self.file.read()
        # What a killed driver has left half-written.
        whole = text.rfind(b"\n") + 1
        self.file.truncate(whole)
        try:
            lines = [json.loads(line) for line in text[:whole].splitlines()]
        except ValueError as error:
            raise Error(f"{self.path}: is no journal, or is damaged: {error}; give another one") from None
        about = {"schema": SCHEMA, **about}
        if lines and lines[0] != about:
            raise Error(f"{self.path}: was written with {lines[0]}, and not {about}; give the same again, or another journal")
        if not lines:
            self._write(about)
        for line in lines[1:]:
            (self.points if "point" in line else self.results)[line["n"]] = line.get("point", line.get("result"))

    def _alone(self) -> None:
        try:
            import fcntl
        except ImportError:  # Not on Windows.
            return
        try:
            fcntl.flock(self.file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise Error(f"{self.path}: another process writes this journal; wait for it, or give another one") from None

    def _write(self, line: dict[str, Any]) -> Any:
        text = json.dumps(line, default=_run.plain)
        self.file.write(text.encode() + b"\n")
        self.file.flush()
        os.fsync(self.file.fileno())
        return json.loads(text)

    def point(self, n: int, point: Any) -> Any:
        """Point ``n`` as JSON has it, in the journal from now on."""
        if n not in self.points:
            self.points[n] = self._write({"n": n, "point": point})["point"]
            return self.points[n]
        before, now = (json.dumps(value, default=_run.plain) for value in (self.points[n], point))
        if before != now:
            raise Error(f"{self.path}: point {n} was {before}, and is now {now}: who chooses is another one; give another journal")
        return self.points[n]

    def result(self, n: int, result: Any) -> Any:
        """The result of point ``n`` as JSON has it, in the journal from now on."""
        return self._write({"n": n, "result": result})["result"]


def adaptive(
    ask: Callable[[], Any],
    tell: Callable[[Any, Any], None],
    evaluate: Callable[[Any], Any],
    *,
    budget: int,
    journal: Path,
    parallel: int = 1,
    rounds: bool = False,
    max_retries: int = 20,
    num_cpus: float = 1,
) -> list[tuple[Any, Any]]:
    """Evaluates points on Ray that are chosen by what came of those before.

    ``parallel`` points are under way at any time: as one is done its result is told, and the next one is asked for. That order depends on
    how long each takes, and so may the points. With ``parallel=1``, and with ``rounds``, it does not: points and results are then the same
    in every run, if ``ask`` and ``evaluate`` depend on nothing else.

    Evaluations that are under way when it ends by an error or Ctrl-C run to their end, or end with Ray; their results are not used.

    A driver that was killed goes on when it is called again with the same journal: ``ask`` and ``tell`` are called anew in the order of the
    journal, so that who chooses knows what it knew, results in it are not evaluated again, and only then new points are. So ``ask`` must
    begin where it began the first time, and may draw at random only from a generator with a seed of its own.

    Args:
        ask: Gives the next point, anything that JSON can say; None as long as it wants results first, and in the end.
        tell: Is given a point and its result.
        evaluate: Makes a result, which JSON can say, of a point, in a worker's process; at most ``1 + max_retries`` times.
        budget: How many points at most; may be more when a search is gone on with.
        journal: A file, JSON lines: made where there is none, gone on with where there is one.
        parallel: How many points are evaluated at the same time.
        rounds: Whether all of them are waited for, and told in the order in which they were asked for, before the next ones are asked for.
        max_retries: How often a point is evaluated again whose worker was killed, or that raised :class:`grip.campaign.TryAgain`.
        num_cpus: Processors of an evaluation.

    Returns:
        Points and results, in the order in which the points were asked for.

    Raises:
        Error: When the journal is of another search, or another process writes it.
        Exception: What ``evaluate`` raises, and what Ray raises when a worker was killed too often; the journal has all that is done.
    """
    if budget < 0 or parallel < 1:
        raise Error(f"budget = {budget}, parallel = {parallel}: give counts from 0 and from 1 on")
    task, book = _remote(num_cpus, max_retries), _Journal(journal, parallel=parallel, rounds=rounds)
    points: list[Any] = []
    results: dict[int, Any] = {}
    flight: dict[int, Any] = {}

    def ended() -> int:
        # In the order in which they ended before, then as they end.
        n = next((n for n in book.results if n in flight), None)
        if n is None:
            (done,), _ = ray.wait(list(flight.values()))
            n = next(n for n, ref in flight.items() if ref == done)
            del flight[n]
            results[n] = book.result(n, ray.get(done))
        else:
            del flight[n]
            results[n] = book.results.pop(n)
        return n

    try:
        while True:
            while len(flight) < parallel and len(points) < budget:
                point = ask()
                if point is None:
                    break
                n = len(points)
                points.append(book.point(n, point))
                ref = None if n in book.results else task.options(name=f"grip point {n}").remote(evaluate, points[n])
                flight[n] = ref
            if not flight:
                return [(point, results[n]) for n, point in enumerate(points)]
            for n in sorted(ended() for _ in range(len(flight) if rounds else 1)):
                tell(points[n], results[n])
    finally:
        book.file.close()

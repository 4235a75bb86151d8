"""Workers over Ray, on this machine or on a cluster: TorchRL's ``RayCollector``, with what it lacks.

What is done around it, by the source of torchrl 0.14.1 and ray 2.60:

- its default of ``total_frames=-1``, without end elsewhere, is an end before the first batch here;
- weights go to the workers through Ray itself: the scheme that it has for them opens a ``TCPStore`` that listens on
  all of the machine's addresses, and who loses a worker while they are pushed waits a minute for it;
- Ray on this machine alone would listen on all addresses too, and takes SIGTERM for itself;
- the numbers of episodes in ``("collector", "traj_ids")`` are each worker's own; nothing here reads them;
- whoever asks for more workers than there are processors waits forever.
"""

from __future__ import annotations

import logging
import os
import re
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from threading import Timer
from typing import Any

from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torchrl.collectors.distributed import RayCollector
from torchrl.envs import EnvBase

from ibe_rl.config.settings import CollectConfig
from ibe_rl.runtime.workers import ANSWER_S, POLL_S, START_S, LostWorkerError
from ibe_rl.types import ConfigError

HERE = {"address": "local", "include_dashboard": False}
"""Ray on this machine, for this run alone."""


def check_ray(config: CollectConfig) -> None:
    """Refuse, before anything is made, what is not installed or not there.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    check_installed("collect.engine=ray", "processes")
    if config.address is not None:
        check_address("collect.address", config.address)


def check_installed(setting: str, allowed: str) -> None:
    """Refuse a setting that wants Ray where there is none.

    Raises:
        ConfigError: naming the setting and what is allowed.
    """
    if find_spec("ray") is None:
        raise ConfigError(f"{setting}: Ray is not installed (pip install 'ibe_rl[ray]'); allowed is {allowed}")


def check_address(key: str, address: str) -> None:
    """Refuse the address of a cluster where nobody answers.

    Raises:
        ConfigError: naming the key, the address and what is allowed.
    """
    host, _, port = address.rpartition(":")
    try:
        socket.create_connection((host, int(port)), ANSWER_S).close()
    except (OSError, ValueError, OverflowError) as error:
        raise ConfigError(
            f"{key}={address}: allowed is host:port of a Ray cluster that this machine is part of ({error})"
        ) from None


class RayWorkers(RayCollector):
    """TorchRL's collector, whose batches are ``[W, N, T]`` in the order of the workers.

    Args:
        factories: of the environments of each worker.
        policy: that all of them follow.
        frames: of a batch, of all workers.
        config: ``address`` and ``timeout_s`` of it are read.

    Raises:
        ConfigError: if there is no such cluster, or it is too small.
        LostWorkerError: if a worker does not get ready.
    """

    def __init__(
        self,
        factories: Sequence[Callable[[], EnvBase]],
        policy: TensorDictModuleBase,
        frames: int,
        config: CollectConfig,
    ):
        import ray

        connect(config.address, len(factories))
        _check_room(len(factories))
        allowed_s = max(config.timeout_s or 0.0, START_S)
        late: list[bool] = []

        def give_up() -> None:
            late.append(True)
            Actors(self._remote_collectors).kill()

        self._remote_collectors: list[Any] = []
        timer = Timer(allowed_s, give_up)
        timer.daemon = True
        timer.start()
        try:  # it waits until all are ready
            super().__init__(
                list(factories),
                policy,
                frames_per_batch=frames,
                total_frames=sys.maxsize,
                sync=True,
                weight_sync_schemes={},
                collector_kwargs={"auto_register_policy_transforms": False},
                remote_configs={"num_cpus": 1, "scheduling_strategy": "SPREAD"},
            )
        except (Exception, SystemExit) as error:  # Ray raises its own, others, and exits where its core is gone
            why = f"they were not ready within {allowed_s:g} s" if late else _first_error(str(error))
            self._remote_collectors.clear()
            ray.shutdown()
            raise LostWorkerError(f"the workers could not be started: {why}") from None
        finally:
            timer.cancel()
        self._weight_sync_initialized = True  # update_policy_weights_ does it, without the schemes
        self.workers = Actors(self.remote_collectors)

    def update_policy_weights_(self, weights: TensorDictBase) -> None:
        """Let all workers have the weights, and the policy's buffers; back when they do."""
        self.map_fn("update_policy_weights_", list_of_args=[(weights,)] * len(self.remote_collectors))

    def shutdown(self, timeout: float | None = None, shutdown_ray: bool = True) -> None:
        """End the workers, and Ray if it was started for them."""
        super().shutdown(timeout, shutdown_ray)


def connect(address: str | None, processors: int = 1, key: str = "collect.address") -> None:
    """Connect to a cluster, or start one that ends with this process.

    Args:
        address: of the cluster; None starts one.
        processors: that one which is started has.
        key: what the address is called in an error.

    Raises:
        ConfigError: if there is no such cluster.
    """
    import ray
    from ray._private import ray_constants

    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # it would tell its makers about each start
    os.environ.setdefault("RAY_ENABLE_AUTO_CONNECT", "0")  # it would start anew for who calls a worker after the end
    if not address:
        ray_constants.ENABLE_RAY_CLUSTER = False  # then it listens on 127.0.0.1 only; its setting is read too early
    where = {"address": address} if address else {**HERE, "num_cpus": processors}
    try:
        with _keeps_sigterm():
            ray.init(**where, log_to_driver=False, logging_level=logging.ERROR)
    except (ConnectionError, ValueError, RuntimeError, SystemExit) as error:  # it exits where its own do not start
        ray.shutdown()
        first = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise ConfigError(f"{key}={address}: allowed is the address of a Ray cluster ({first})") from None


def _check_room(workers: int) -> None:
    """Refuse more workers than processors are free; a new cluster takes some time to tell."""
    import ray

    until = time.monotonic() + ANSWER_S
    while (free := int(ray.available_resources().get("CPU", 0))) < workers and time.monotonic() < until:
        time.sleep(POLL_S)
    if free < workers:
        ray.shutdown()
        raise ConfigError(f"collect.processes={workers}: allowed is at most {free}, the free processors of the cluster")


@contextmanager
def _keeps_sigterm() -> Iterator[None]:
    before = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


class Actors:
    """See ``ibe_rl.runtime.workers.Workers``.

    Args:
        actors: of ``RayCollector``, in the order of the workers.
    """

    def __init__(self, actors: Sequence[Any]):
        self._actors = list(actors)
        self.names = [f"worker {number} of {len(actors)} (over Ray)" for number in range(len(actors))]

    def _asked(self, within_s: float) -> list[Exception | bool]:
        """What each of them answers: True; False if it does not in time, or why it cannot."""
        import ray

        asked = [_ask(actor) for actor in self._actors]
        waiting = [answer for answer in asked if not isinstance(answer, Exception)]
        ready = ray.wait(waiting, num_returns=len(waiting), timeout=within_s)[0] if waiting else []
        return [_answer(one) if one in ready else isinstance(one, Exception) and one for one in asked]

    def dead(self, error: Exception | None = None) -> list[str]:
        """See ``Workers``; as long as no error has come from them nobody is asked."""
        if error is None:
            return []
        answers = zip(self.names, self._asked(ANSWER_S), strict=True)
        return [f"{name} {_why(answer)}" for name, answer in answers if isinstance(answer, Exception)]

    def silent(self) -> list[str]:
        """See ``Workers``."""
        return [name for name, answer in zip(self.names, self._asked(ANSWER_S), strict=True) if answer is not True]

    def kill(self) -> None:
        """See ``Workers``."""
        import ray

        for actor in self._actors:
            with suppress(ray.exceptions.RayError, ValueError):
                ray.kill(actor)


def _ask(actor: Any) -> Any:
    try:
        return actor.get_distant_attr.remote("closed")
    except Exception as error:  # Ray's core raises nothing else when it knows of no such worker any more
        return error


def _answer(answer: Any) -> Exception | bool:
    import ray

    try:
        ray.get(answer)
    except ray.exceptions.RayError as error:
        return error
    return True


def _first_error(told: str) -> str:
    """The line of a worker's traceback that says what was wrong."""
    found = re.findall(r"^\s*(?:\w+\.)*(\w+(?:Error|Exception): .+)$", told, re.MULTILINE)
    return found[0] if found else (told.strip() or "for no reason known").splitlines()[0]


def _why(error: Exception | bool) -> str:
    """What Ray tells of an end, in a few words."""
    told = str(error)
    where = ", ".join(found[0] for key in ("pid", "ip") if (found := re.search(rf"{key}: \S+", told)))
    what = "its machine is gone" if re.search(r"\bnode\b.*(died|dead|removed|terminated)", told) else "it has ended"
    return f"is lost: {what} ({where})" if where else f"is lost: {what} ({told.strip().splitlines()[-1]})"

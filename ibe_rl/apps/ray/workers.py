"""Workers over Ray, on this machine or on a cluster: TorchRL's ``RayCollector`` with workarounds.

Reasons for them in the source of torchrl 0.14.1 and ray 2.60:

- ``total_frames=-1``, endless in other collectors, ends before the first batch here;
- its weight scheme opens a ``TCPStore`` that listens on all addresses, and waits a minute for a worker lost during
  the transfer; weights therefore go through Ray itself;
- a local Ray would listen on all addresses too, and replaces the SIGTERM handler;
- the numbers of episodes in ``("collector", "traj_ids")`` are per worker; nothing here reads them;
- asking for more workers than processors blocks forever.
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
"""A local Ray for this run only."""


def check_ray(config: CollectConfig) -> None:
    """Check that Ray is installed and the cluster reachable, before anything is made.

    Raises:
        ConfigError: naming the key, the value and what is allowed.
    """
    check_installed("collect.engine=ray", "processes")
    if config.address is not None:
        check_address("collect.address", config.address)


def check_installed(setting: str, allowed: str) -> None:
    """Refuse a setting that needs Ray where it is not installed.

    Raises:
        ConfigError: naming the setting and what is allowed.
    """
    if find_spec("ray") is None:
        raise ConfigError(f"{setting}: Ray is not installed (pip install 'ibe_rl[ray]'); allowed is {allowed}")


def check_address(key: str, address: str) -> None:
    """Refuse the address of a cluster that does not answer.

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
    """TorchRL's collector; batches are ``[W, N, T]`` in the order of the workers.

    Args:
        factories: one for the environments of each worker.
        policy: of all workers.
        frames: of a batch, over all workers.
        config: only ``address`` and ``timeout_s`` are read.

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
        try:  # returns when all are ready
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
        except (Exception, SystemExit) as error:  # Ray may raise anything, and exits if its core is lost
            why = f"they were not ready within {allowed_s:g} s" if late else _first_error(str(error))
            self._remote_collectors.clear()
            ray.shutdown()
            raise LostWorkerError(f"the workers could not be started: {why}") from None
        finally:
            timer.cancel()
        self._weight_sync_initialized = True  # done by update_policy_weights_, without schemes
        self.workers = Actors(self.remote_collectors)

    def update_policy_weights_(self, weights: TensorDictBase) -> None:
        """Send weights and the policy's buffers to all workers; returns when they have them."""
        self.map_fn("update_policy_weights_", list_of_args=[(weights,)] * len(self.remote_collectors))

    def shutdown(self, timeout: float | None = None, shutdown_ray: bool = True) -> None:
        """Stop the workers, and Ray if it was started for them."""
        super().shutdown(timeout, shutdown_ray)


def connect(address: str | None, processors: int = 1, key: str = "collect.address") -> None:
    """Connect to a cluster, or start one that ends with this process.

    Args:
        address: of the cluster; None starts one.
        processors: of a cluster that is started.
        key: name of the address in an error.

    Raises:
        ConfigError: if there is no such cluster.
    """
    import ray
    from ray._private import ray_constants

    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # else each start is reported to its makers
    os.environ.setdefault("RAY_ENABLE_AUTO_CONNECT", "0")  # else a call after the end restarts Ray
    if not address:
        ray_constants.ENABLE_RAY_CLUSTER = False  # listens on 127.0.0.1 only; the variable is read too early
    where = {"address": address} if address else {**HERE, "num_cpus": processors}
    try:
        with _keeps_sigterm():
            ray.init(**where, log_to_driver=False, logging_level=logging.ERROR)
    except (ConnectionError, ValueError, RuntimeError, SystemExit) as error:  # exits if its processes do not start
        ray.shutdown()
        first = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise ConfigError(f"{key}={address}: allowed is the address of a Ray cluster ({first})") from None


def _check_room(workers: int) -> None:
    """Refuse more workers than free processors; a new cluster reports them after some time."""
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
        """The answer of each worker: True, False on timeout, or the error."""
        import ray

        asked = [_ask(actor) for actor in self._actors]
        waiting = [answer for answer in asked if not isinstance(answer, Exception)]
        ready = ray.wait(waiting, num_returns=len(waiting), timeout=within_s)[0] if waiting else []
        return [_answer(one) if one in ready else isinstance(one, Exception) and one for one in asked]

    def dead(self, error: Exception | None = None) -> list[str]:
        """See ``Workers``; without an error the workers are not asked."""
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
    except Exception as error:  # what Ray's core raises for an unknown worker
        return error


def _answer(answer: Any) -> Exception | bool:
    import ray

    try:
        ray.get(answer)
    except ray.exceptions.RayError as error:
        return error
    return True


def _first_error(text: str) -> str:
    """The line of a worker's traceback that names the error."""
    found = re.findall(r"^\s*(?:\w+\.)*(\w+(?:Error|Exception): .+)$", text, re.MULTILINE)
    return found[0] if found else (text.strip() or "for an unknown reason").splitlines()[0]


def _why(error: Exception | bool) -> str:
    """Ray's reason for the end of a worker, in a few words."""
    text = str(error)
    where = ", ".join(found[0] for key in ("pid", "ip") if (found := re.search(rf"{key}: \S+", text)))
    what = "its machine is gone" if re.search(r"\bnode\b.*(died|dead|removed|terminated)", text) else "it has ended"
    return f"is lost: {what} ({where})" if where else f"is lost: {what} ({text.strip().splitlines()[-1]})"

"""Loggers: a run in TensorBoard, Weights & Biases, MLflow or files of values, while it trains.

``run_logger`` is the listener that all share: it turns events into rows, texts and pictures, and hands them to a
thread (``background``), so that training never waits for a network. ``pictures`` draws a refresh, ``phrase_table``
is its vocabulary as rows. ``tensorboard``, ``wandb``, ``mlflow`` and ``csv`` each open TorchRL's logger of that name.

In: the events that listeners receive; the settings of ``configs/logger``.
Out: what these programs read, below the folder ``loggers`` of the run or at their server.
Imports: any room; nothing imports it, ``config`` reaches it by the ``kind`` in a YAML file.
"""

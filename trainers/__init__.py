"""Training, evaluation and reports. Depends on the specs of environments, never on their classes.

    config       the settings of a run (imports no torch)
    environment  what training expects of an environment
    run          the training loop, its metrics and checkpoints
    collect      workers that collect batches, in this process or others
    algorithms   PPO, SAC, imitation and the other algorithms, found by name
    models       policies and critics, built from specs
    evaluation   success, chains, instruction ablations, videos
    cluster      collection, sweeps and evaluation on a Ray cluster
    sweeps       several runs at a time, and the records that runs leave
    reports      figures, tables and statistics of finished runs
    datasets     demonstrations as LeRobot and Minari datasets
    export       published policies with their cards
    utils        atomic files, and safe reading of tensors

An iteration of training is `run/train_loop.py`, `collect/rollouts.py`, `collect/worker.py`, then `algorithms/` and
`models/`. This file imports no torch, so that the command line starts quickly.
"""

import os

os.environ.setdefault("RL_LOGGING_LEVEL", "WARNING")  # no messages about buffers; TorchRL reads it when imported

"""Training, evaluation and reports. Depends on the specs of environments, never on their classes.

    config       the parameters of a run (imports no torch)
    algorithms   PPO, SAC, imitation and the other algorithms, found by name
    models       policies and critics, built from specs
    rollout      collection of batches, evaluation, instruction ablations, videos
    run          the training loop, its metrics and checkpoints
    sweeps       several runs at a time, and the records that runs leave
    reports      figures, tables and statistics of finished runs
    datasets     demonstrations as LeRobot and Minari datasets
    export       published policies with their cards
    utils        atomic file writes, optional imports, system information

This file imports no torch, so that the command line starts quickly.
"""

import os

os.environ.setdefault("RL_LOGGING_LEVEL", "WARNING")  # no messages about buffers; TorchRL reads it when imported

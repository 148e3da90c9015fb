"""Networks, PPO, SAC, collection, evaluation, checkpoints and reports. Sees specs, never environments' classes.

    config       what a run may set (imports no torch)
    policy       networks from specs          grounding   which object do the words mean
    ppo, sac     one algorithm each
    collection   worlds ─► batches            evaluation  how often does it do what it was told
    checkpoint   files that survive a kill    metrics     metrics.csv, loggers, eval.json
    policy_file  a policy alone            publish     one with its card, from a finished run
    demonstrations  episodes to be kept       dataset     ... as LeRobot's (as_lerobot) or Minari's (as_minari)
    fit          collect ─► update ─► evaluate ─► report
    sweep, job   several runs at a time       report      what they came to: report.html, report.md

This file stays free of torch so that the command line answers at once.
"""

import os

# TorchRL reads this when it is first imported: seconds that a worker and its parent wait for one another before
# they give up. Its own default is for ever, which turns a stuck worker into a hang.
os.environ.setdefault("MAX_IDLE_COUNT", "600")
os.environ.setdefault("RL_LOGGING_LEVEL", "WARNING")  # no notes on buffers made, between a person and the result

"""A whole training run in seconds: it learns nothing, but writes all files of a run."""

TINY = [
    "total_frames=256",
    "collector.workers=1",
    "collector.worlds=4",
    "algo.horizon=16",
    "algo.minibatch=16",
    "eval.episodes=4",
    "eval.interval_episodes=4",
    "eval.worlds=4",
    "eval.video_episodes=0",
    "logger=[]",
]
TINY_RUN = [*TINY, "seed=5", "task.max_steps=12"]  # what the fixture `tiny_run` trains

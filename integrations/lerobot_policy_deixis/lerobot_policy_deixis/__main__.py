"""Write a policy of Deixis as a directory of LeRobot: `python -m lerobot_policy_deixis <checkpoint> <new directory>`.

The directory is for `--policy.path` of LeRobot's programs. It needs no other file, but this package.
"""

from __future__ import annotations

from pathlib import Path

from core.errors import ConfigError
from core.program import run_program
from lerobot_policy_deixis.configuration_deixis import DeixisConfig
from lerobot_policy_deixis.modeling_deixis import DeixisPolicy
from lerobot_policy_deixis.processor_deixis import make_deixis_pre_post_processors
from trainers.utils.files import atomic_directory

USAGE = "give a checkpoint and a new directory: python -m lerobot_policy_deixis nl_reach_kuka outputs/for_lerobot"


def main(arguments: list[str]) -> None:
    """Write the directory. Raises ConfigError."""
    if len(arguments) != 2:
        raise ConfigError(USAGE)
    policy = DeixisPolicy(DeixisConfig(checkpoint=arguments[0]))
    with atomic_directory(Path(arguments[1])) as folder:
        policy.save_pretrained(folder)
        for steps in make_deixis_pre_post_processors(policy.config):
            steps.save_pretrained(folder)
    print(f"{policy.acting.path} as a policy of LeRobot: {arguments[1]}")


if __name__ == "__main__":
    run_program(main, __file__)

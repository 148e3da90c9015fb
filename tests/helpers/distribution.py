"""Which process runs a test: a file is run by one process, and the files that take longest come first.

Else the fixtures of a module are built twice, and at the end one process waits for the other.
"""

from __future__ import annotations

import pytest
from xdist.scheduler.loadscope import LoadScopeScheduling

# Files that share a fixture of the session, each with the name of their group.
GROUPS = {
    "tests/trainers/cluster/test_ray_host.py": "ray",
    "tests/trainers/cluster/test_ray_map.py": "ray",
    "tests/trainers/cluster/test_ray_sweep.py": "ray",
    "tests/trainers/datasets/test_dataset.py": "recordings",
    "tests/trainers/datasets/test_demonstrations.py": "recordings",
    "tests/trainers/datasets/test_lerobot_dataset.py": "recordings",
    "tests/trainers/datasets/test_minari_dataset.py": "recordings",
    "tests/trainers/datasets/test_verify_replay.py": "recordings",
}
# Groups, and files without a group, that take more than ten seconds: those that wait for processes, then longest first.
LONGEST = [
    "ray",
    "tests/demo/test_page.py",
    "tests/test_sweeps.py",
    "tests/test_command_line.py",
    "tests/tools/test_examples.py",
    "tests/trainers/run/test_train_loop.py",
    "tests/test_package.py",
    "tests/benchmarks/test_time_to_success.py",
    "tests/test_command_line_signals.py",
    "tests/envs/test_gym_vector_env.py",
    "tests/trainers/algorithms/test_bc.py",
    "tests/demo/test_arm_page.py",
    "tests/trainers/run/test_resume.py",
    "tests/core/test_own_package.py",
    "tests/deixis/test_warm.py",
    "tests/demo/test_study_server.py",
    "tests/tools/test_extending_pages.py",
    "tests/trainers/algorithms/test_compiled.py",
    "tests/envs/sim/test_window.py",
    "tests/demo/test_recording_panel.py",
    "tests/deixis/test_export.py",
    "tests/faults/test_page_attacks.py",
    "tests/trainers/sweeps/test_submitit.py",
    "tests/faults/test_other_systems.py",
    "tests/tools/test_instruction_sets.py",
    "tests/trainers/collect/test_collection.py",
    "tests/envs/test_workspace_env.py",
    "tests/envs/experts/test_experts.py",
    "tests/envs/test_gym_env.py",
    "tests/envs/tasks/test_referring.py",
    "tests/envs/tasks/test_reach_gesture.py",
    "tests/core/test_path_keys.py",
    "tests/core/test_overrides.py",
    "tests/envs/test_workspace_env_determinism.py",
    "tests/envs/sim/test_devices.py",
    "tests/envs/test_workspace_env_determinism_grasping.py",
    "tests/envs/sim/test_gripper.py",
    "tests/faults/test_hostile_files.py",
]


def group_of(node: str) -> str:
    """Return the group, or else the file, of a test."""
    file = node.partition("::")[0]
    return GROUPS.get(file, file)


def sort_longest_first(items: list[pytest.Item]) -> None:
    """Sort the tests of a group together, and those of `LONGEST` before all others."""
    groups = dict.fromkeys([*LONGEST, *(group_of(item.nodeid) for item in items)])
    ranks = {group: rank for rank, group in enumerate(groups)}
    items.sort(key=lambda item: ranks[group_of(item.nodeid)])


class GroupScheduling(LoadScopeScheduling):
    """Gives each process one group after another, in the order of the tests."""

    def __init__(self, config: pytest.Config, log: object = None) -> None:
        config.option.loadscopereorder = False
        super().__init__(config, log)

    def _split_scope(self, nodeid: str) -> str:
        return group_of(nodeid)

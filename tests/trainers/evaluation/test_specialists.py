"""A policy for each verb, in place of one policy for all."""

import shutil
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import torch
import yaml
from tensordict import TensorDict
from tensordict.nn import TensorDictModule

import evaluate
from core.errors import ConfigError
from envs import read_env
from envs.workspace_env import WorkspaceEnv
from trainers.evaluation.chains import run_chains
from trainers.evaluation.specialists import Specialists, load_specialists
from trainers.run import checkpoint
from trainers.run.checkpoint import fitted_policy

POLICY = checkpoint.find(Path("anything_kuka"))


@pytest.fixture(scope="module")
def saved():
    return checkpoint.load(POLICY)


def runs_of(saved, verbs, folder):
    """Runs of these verbs in a folder, all with the same pretrained policy."""
    for number, verb in enumerate(verbs):
        place = folder / f"{number}_{verb}"
        place.mkdir(parents=True)
        config = saved["config"] | {"task": saved["config"]["task"] | {"verbs": [verb]}}
        (place / "config.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
        shutil.copy(POLICY, place)
    return folder


def make(saved, worlds=1, instructions=1):
    return WorkspaceEnv(read_env(saved["config"]).without_curriculum().with_instructions(instructions), worlds, 0)


def test_in_each_world_the_policy_for_the_kind_of_its_instruction_acts():
    policies = {
        kind: TensorDictModule(lambda robot, kind=kind: robot + 10 * kind, in_keys=["robot"], out_keys=["action"])
        for kind in range(3)
    }
    kinds = np.array([2, 0, 2, 1, 0])
    robot = torch.arange(10.0).reshape(5, 2)
    acted = Specialists(policies, lambda: kinds)(TensorDict({"robot": robot}, [5]))
    assert torch.equal(acted["action"], robot + 10 * torch.from_numpy(kinds)[:, None])


@pytest.mark.slow
def test_the_same_policy_for_every_verb_carries_out_the_same_chains(saved, tmp_path):
    with closing(make(saved, worlds=3, instructions=2)) as env:
        one = fitted_policy(saved, saved["config"], env).act
        specialists = load_specialists(runs_of(saved, env.kind_names, tmp_path), env, lambda: env.state.kind)
        chains = run_chains(env, one, 3, seed=3)
        assert len({kind for chain in chains for kind in chain.kinds}) > 2
        assert run_chains(env, specialists, 3, seed=3) == chains


@pytest.mark.slow
@pytest.mark.parametrize("wrong", ["a verb without a run", "two runs of a verb"])
def test_each_verb_has_exactly_one_run(saved, tmp_path, wrong):
    with closing(make(saved)) as env:
        verbs = list(env.kind_names)
        verbs, message = (
            (verbs[:-1], f"0 for {verbs[-1]}") if "without" in wrong else ([*verbs, "stack"], "2 for stack")
        )
        folder = runs_of(saved, verbs, tmp_path)
        with pytest.raises(ConfigError, match=rf"specialists=.* must hold one run .* holds {message}$"):
            load_specialists(folder, env, lambda: env.state.kind)


def test_experts_and_specialists_do_not_go_together(tmp_path):
    with pytest.raises(ConfigError, match=r"specialists=.* needs reader=policy; reader=expert"):
        evaluate.main(["checkpoint=anything_kuka", f"specialists={tmp_path}", "reader=expert", "chains=2"])

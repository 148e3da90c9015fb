"""The public check of environments: it passes the project's own, and finds what is planted."""

from __future__ import annotations

import pytest
import torch

from core.overrides import compose
from envs import check_env
from envs.checker import EnvError
from envs.config import read_env
from envs.workspace_env import WorkspaceEnv

OVERRIDES = ["task=nl_reach", "task.max_steps=20"]
GLOBAL = torch.Generator()


class Planted(WorkspaceEnv):
    """An environment with one bug, named by `bug`."""

    bug = ""

    def close(self, **_):
        """Kept for the next check; the fixture closes it."""

    def __init__(self, worlds, seed):
        super().__init__(read_env(compose(OVERRIDES)), worlds, seed)
        self.given = 0

    def _step(self, tensordict):
        action = tensordict["action"]
        if self.bug == "the action is changed in place":
            action.clamp_(-0.5, 0.5)
        if self.bug == "the action has no effect":
            tensordict = tensordict.clone(recurse=False).set("action", torch.zeros_like(action))
        if self.bug == "the action is not clipped":
            tensordict = tensordict.clone(recurse=False).set("action", (action / 3).clamp(-1, 1))
        if self.bug == "a NaN action is accepted":
            tensordict = tensordict.clone(recurse=False).set("action", action.nan_to_num(0.0))
        return self._spoilt(super()._step(tensordict), True)

    def _spoilt(self, td, stepped):
        bug, n = self.bug, self.batch_size[0]
        self.given += stepped
        if bug == "an observation is NaN":
            td["robot"][0, 0] = float("nan")
        elif bug == "a reward is infinite" and stepped:
            td["reward"][0] = float("inf")
        elif bug == "an observation lies outside of its spec":
            td["robot"] += 1000
        elif bug == "an observation has another type":
            td["robot"] = td["robot"].double()
        elif bug == "an observation has another shape":
            td["robot"] = td["robot"][:, :-1]
        elif bug == "an observation is missing":
            del td["hold"]
        elif bug == "the reward is not the sum of its terms" and stepped:
            td["reward"] += 0.1
        elif bug == "observations depend on global randomness":
            td["objects"] = td["objects"] + 1e-6 * torch.rand((), generator=GLOBAL) * td["objects_mask"][..., None]
        elif bug == "observations depend on the number of worlds":
            td["robot"][:, 0] += 1e-4 * n
        elif bug == "observations depend on earlier episodes":
            td["robot"][:, 0] += 1e-6 * self.given
        elif bug == "ends are both" and stepped:
            td["terminated"] |= td["truncated"]
        elif bug == "done lacks truncation" and stepped:
            td["done"] = td["terminated"].clone()
        elif bug == "the words are not the sentence":
            td["instruction"] = td["instruction"].roll(1, 1)
        elif bug == "a buffer is returned":
            self.buffer = getattr(self, "buffer", td["robot"]).copy_(td["robot"])
            td["robot"] = self.buffer
        elif bug == "the referent is hidden":
            td["privileged", "referent"] = (~td["objects_mask"]).int().argmax(1)
            td["objects_mask"][:, -1] = False
            td["objects"][:, -1] = 0
            td["privileged", "referent"][:] = td["objects_mask"].shape[1] - 1
        elif bug == "episodes never end" and stepped:
            for name in ("done", "terminated", "truncated", "success", "wrong_object"):
                td[name] = torch.zeros_like(td[name])
        return td

    def _reset(self, tensordict=None, **options):
        if self.bug == "a reset begins all worlds" and tensordict is not None:
            tensordict = None
        if self.bug == "a reset of one world does nothing" and tensordict is not None and "_reset" in tensordict.keys():
            return self._first_observation()
        if self.bug == "every reset begins the same episode":
            self._set_seed(5)
        td = self._spoilt(super()._reset(tensordict, **options), False)
        if self.bug == "flags are not cleared":
            td["success"] |= True
        return td

    def _set_seed(self, seed):
        super()._set_seed(3 if self.bug == "the seed is ignored" else seed)
        if self.bug == "all worlds begin with the same episode":
            super()._set_seed(seed)
            first = self._generators[0].bit_generator.state
            for generator in self._generators:
                generator.bit_generator.state = first


BUGS = {  # bug -> what the check says
    "an observation is NaN": "robot: not all numbers are finite",
    "a reward is infinite": "reward: not all numbers are finite",
    "an observation lies outside of its spec": "robot: values lie outside of its spec",
    "an observation has another type": "robot: torch.float64",
    "an observation has another shape": "robot: torch.float32",
    "an observation is missing": "hold: missing after reset",
    "the reward is not the sum of its terms": "reward is not the sum of reward_terms",
    "observations depend on global randomness": "the same seed and actions give other values",
    "observations depend on earlier episodes": "the same seed and actions give other values",
    "observations depend on the number of worlds": "world 0 depends on the number of worlds",
    "ends are both": "terminated and truncated are both true",
    "done lacks truncation": "done is not terminated or truncated",
    "episodes never end": "an episode has not ended after",
    "the words are not the sentence": "instruction: the tokens are not those",
    "a buffer is returned": "robot: a returned value changes",
    "the referent is hidden": "privileged/referent: the slot of the referent shows nothing",
    "the action is changed in place": "action: changed by a step",
    "the action has no effect": "action: has no effect",
    "the action is not clipped": "action: numbers beyond",
    "a NaN action is accepted": "action: NaN is accepted",
    "a reset begins all worlds": "a reset of one world changes the others",
    "a reset of one world does nothing": "the world that is reset stays as it is",
    "every reset begins the same episode": "every reset begins the same episode",
    "flags are not cleared": "success: true after a reset",
    "the seed is ignored": "another seed begins with the same episodes",
    "all worlds begin with the same episode": "all worlds begin with the same episode",
}


@pytest.fixture(scope="module")
def make():
    """`make(bug)` gives a `make` for the check: environments with that bug, which are built once."""
    made = {}

    def planted(bug):
        def build(worlds, seed):
            env = made.setdefault(worlds, None) or Planted(worlds, seed)
            made[worlds], env.bug, env.given = env, bug, 0
            vars(env).pop("buffer", None)
            env.set_seed(seed)
            return env

        return build

    yield planted
    for env in made.values():
        WorkspaceEnv.close(env)


@pytest.mark.slow
def test_an_environment_of_the_project_passes(make):
    check_env(make(""))


@pytest.mark.slow
@pytest.mark.parametrize("bug", BUGS)
def test_a_planted_bug_is_found_and_named(bug, make):
    with pytest.raises(EnvError) as caught:
        check_env(make(bug), max_steps=40)
    assert BUGS[bug] in str(caught.value)


@pytest.mark.parametrize(("key", "named"), [("robot", "the observation robot"), ("action", "an action")])
def test_a_step_names_the_observation_that_is_not_finite(key, named, make):
    env = make("")(3, 0)
    state = env.reset().set("action", torch.full(env.action_spec.shape, float("nan")))
    state[key] = torch.full_like(state[key], float("nan"))
    with pytest.raises(ValueError, match=f"^{named} is not a finite number"):
        env.step(state)

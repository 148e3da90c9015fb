"""Chains: how many instructions are carried out in a row."""

import json

import pytest

from envs.experts import expert
from tests.helpers.env_cases import make
from trainers.evaluation.chains import InstructionChain, run_chains, summarize_chains

KINDS = ("reach", "lift", "open")
CHAINS = [
    InstructionChain((0, 1, 2), 3),
    InstructionChain((1,), 0),
    InstructionChain((0, 2), 1),
    InstructionChain((2, 0, 1), 2),
]


def test_shares_count_the_instructions_that_were_carried_out_in_a_row():
    result = summarize_chains(CHAINS, 3, KINDS)
    assert result["chains"] == 4
    assert result["mean_length"] == pytest.approx(1.5)
    assert result["reached"] == [0.75, 0.5, 0.25]
    assert all(
        low <= share <= high for share, (low, high) in zip(result["reached"], result["reached_ci95"], strict=True)
    )
    low, high = result["mean_length_ci95"]
    assert 0 <= low < 1.5 < high <= 3
    assert json.loads(json.dumps(result)) == result


def test_success_is_told_by_task_and_by_transition_the_worst_first():
    result = summarize_chains(CHAINS, 3, KINDS)
    tasks = {name: (row["tried"], row["success"]) for name, row in result["by_task"].items()}
    assert tasks == {"reach": (3, 1.0), "lift": (3, pytest.approx(1 / 3)), "open": (3, pytest.approx(2 / 3))}
    assert list(tasks) == ["lift", "open", "reach"]
    assert result["by_transition"]["start -> lift"]["tried"] == 1
    assert result["by_transition"]["reach -> lift"] == {
        "tried": 2,
        "success": 0.5,
        "ci95": result["by_transition"]["reach -> lift"]["ci95"],
    }
    assert sum(row["tried"] for row in result["by_transition"].values()) == 9


@pytest.mark.slow
def test_the_expert_completes_chains_and_a_still_arm_none():
    env = make("kuka", "step", "anything", "task.instructions=2", "task.max_steps=80", worlds=4)
    chains = run_chains(env, expert(env), 4, seed=3)
    assert len(chains) == 4
    assert sum(chain.reached for chain in chains) >= 7
    assert all(len(chain.kinds) <= 2 for chain in chains)
    again = run_chains(env, expert(env), 4, seed=3)
    assert again == chains
    still = run_chains(env, lambda state: state.set("action", state["hold"]), 4, seed=3)
    assert [chain.reached for chain in still] == [0] * 4
    assert [len(chain.kinds) for chain in still] == [1] * 4
    env.close()

"""What was done of what people at the page meant, by the conditions of the simulator, whatever the page says."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from core.errors import ConfigError
from demo.session import Session
from envs.interactive.interactive_env import InteractiveEnv
from envs.mdp.gestures import make_person
from envs.workspace_env import make_task
from tools.page_people import Script, Wish, begin
from trainers.evaluation.evaluation import wilson

MOST_STEPS = 600  # control steps of one instruction: more than any task has, with the way back to the rest position


@dataclass(frozen=True)
class JudgedInstruction:
    """One instruction. said: the last sentence. page: its last words. success: of what was meant."""

    circumstance: str
    verb: str
    said: str
    page: str
    success: bool
    scene: int

    @property
    def disagrees(self) -> bool:
        """Whether the page says "Done" of a failure, or something else of a success."""
        return self.page.startswith("Done") != self.success


class Witness:
    """Judges by the task's own conditions whether what was meant has been done, whatever the session understood.

    success: after the last control step.
    """

    def __init__(self, env: InteractiveEnv) -> None:
        self._env = env
        self._task = make_task(env.config, 1, make_person(env.config.workspace.human, env.config.gesture))
        self.success = False

    def begin(self, wish: Wish) -> None:
        """Begin to judge what was meant, in the state as it is."""
        self._wish, self.success = wish, False
        self._task.reset(np.zeros(1, np.int64), self._meant())

    def follow(self) -> None:
        """Judge the control step that was taken."""
        if self._env.elapsed[0] == 0:  # an episode of this instruction begins
            self.begin(self._wish)
            return
        self.success = bool(self._task.step(self._meant()).success[0])

    def _meant(self) -> Any:
        """The state with the goal that was meant."""
        env, wish, state = self._env, self._wish, self._env.state
        slots = np.flatnonzero(state.shown[0])
        target = wish.referent if wish.target is None else wish.target
        if env.task.traits.stacks:  # a see-through object marks the place
            target = int(np.flatnonzero(env.scene().targets)[0])
        changes: dict[str, Any] = {"referent": slots[[wish.referent]], "target": slots[[target]]}
        if env.task.verbs:
            changes["kind"] = np.array([env.task.verbs.index(wish.verb)])
        if wish.place is not None:
            objects = state.objects.copy()
            objects[0, slots[target]] = wish.place
            changes["objects"] = objects
        return replace(state, **changes)


def judge(session: Session, count: int, seed: int) -> Iterator[JudgedInstruction]:
    """Judge instructions, in one circumstance after another. seed: of scenes, wishes and words."""
    script = Script(session, np.random.default_rng(seed))
    circumstances, witness = list(script.circumstances()), Witness(session.env)
    for number in range(count):
        circumstance = circumstances[number % len(circumstances)]
        wish = begin(script, circumstance)
        witness.begin(wish)
        for _ in range(MOST_STEPS):
            if not session.busy:
                break
            session.step()
            witness.follow()
        page = script.refusal or session.view.status
        yield JudgedInstruction(circumstance, wish.verb, script.said, page, witness.success, session.seed)


def figures(judged: Sequence[JudgedInstruction]) -> dict[str, Any]:
    """Return the success of instructions with its interval, in all and by circumstance."""
    circumstances = list(dict.fromkeys(each.circumstance for each in judged))
    failed = [each for each in judged if not each.success]
    return {
        **_share(judged),
        "disagreements": sum(each.disagrees for each in judged),
        "by_circumstance": {name: _share([e for e in judged if e.circumstance == name]) for name in circumstances},
        "page_of_failures": dict(Counter(each.page for each in failed).most_common()),
        "failures": [asdict(each) for each in failed],
    }


def _share(judged: Sequence[JudgedInstruction]) -> dict[str, Any]:
    done = sum(each.success for each in judged)
    interval = [round(each, 4) for each in wilson(done, len(judged))]
    return {"instructions": len(judged), "success": round(done / len(judged), 4), "ci95": interval}


def section(name: str, result: dict[str, Any]) -> str:
    """Return the section of a policy's card, in Markdown. result: of the file. Raises ConfigError without one."""
    if missing := [each for each in ("page", "evaluation") if each not in result]:
        raise ConfigError(
            f"{name} has no figures of its {missing[0]} yet: run python -m benchmarks.page_policies {name}"
        )
    page, whole = result["page"], result["evaluation"]
    seeds = page["seeds"]
    count = page["instructions"] // len(seeds)
    rows = [
        ["instructions to the page", interval(page), page["instructions"]],
        *(
            [f"... {circumstance}", interval(part), part["instructions"]]
            for circumstance, part in page["by_circumstance"].items()
        ),
        ["`evaluate.py`", interval(whole), whole["episodes"]],
    ]
    lines = "\n".join(f"| {' | '.join(map(str, row))} |" for row in rows)
    return f"""| judged through | success (95 %) | episodes |
|---|---|---|
{lines}

Page and simulator disagreed about {page["disagreements"]} instructions. Measured on {result["date"]} with commit
{result["commit"]}; benchmarks/page_policies.py tells what the circumstances are.

```
python -m benchmarks.page_policies {name} --count {count} --seed {seeds[0]} --seeds {len(seeds)}
python evaluate.py checkpoint=pretrained/{name} episodes={whole["episodes"]} seed={whole["seed"]}
```
"""


def interval(part: dict[str, Any]) -> str:
    """Return a success with its interval."""
    success = part.get("success", part.get("success_at_end", 0.0))
    return f"{success:.3f} ({part['ci95'][0]:.3f}-{part['ci95'][1]:.3f})"

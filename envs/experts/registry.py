"""The experts, by the task that they do."""

from envs.experts.base import Expert
from envs.experts.devices import PressExpert, SwitchExpert, TurnExpert
from envs.experts.grasp import GraspExpert, LiftExpert
from envs.experts.place import PlaceExpert
from envs.experts.poke import PokeExpert
from envs.experts.push import PushExpert
from envs.experts.reach import ReachExpert
from envs.experts.rotate import RotateExpert
from envs.experts.swipe import SwipeExpert
from envs.experts.throw import ThrowExpert
from envs.workspace_env import WorkspaceEnv

EXPERTS: dict[str, type[Expert]] = {
    "reach": ReachExpert,
    "nl_reach": ReachExpert,
    "reach_gesture": ReachExpert,
    "nl_reach_gesture": ReachExpert,
    "pick_and_place": PlaceExpert,
    "nl_pick_and_place": PlaceExpert,
    "push": PushExpert,
    "nl_push": PushExpert,
    "nl_grasp": GraspExpert,
    "nl_lift": LiftExpert,
    "swipe": SwipeExpert,
    "poke": PokeExpert,
    "throw": ThrowExpert,
    "pick_and_rotate": RotateExpert,
    "press": PressExpert,
    "switch": SwitchExpert,
    "turn": TurnExpert,
}


def expert(env: WorkspaceEnv) -> Expert:
    """The expert that does the environment's task."""
    return EXPERTS[env.config.task.name](env)

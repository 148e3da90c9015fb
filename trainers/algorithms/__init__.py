"""Learning algorithms: our own PPO, SAC and imitation, and adapters that take any loss module of TorchRL.

registry            settings by name; *_config modules register them
algorithm           the base class
on_policy           advantages, epochs and minibatches          ppo, torchrl_on_policy
off_policy          replay, relabelling, gradient steps         sac, torchrl_off_policy
bc                  imitation of an expert
grounding_supervision, replay, relabelling, expert_frames      the parts that algorithms share
"""

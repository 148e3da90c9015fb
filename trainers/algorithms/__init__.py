"""Learning algorithms: our own PPO, SAC and imitation, and adapters that take any loss module of TorchRL.

settings         the settings of each, by name (imports no torch)
algorithm        the base class, the supervision of the grounding, gradient steps
on_policy        advantages, epochs and minibatches          ppo
off_policy       replay, relabelling, gradient steps         sac
bc               imitation of an expert
torchrl_losses   the adapters
replay           what off-policy algorithms keep
"""

"""Controls, observations, rewards, initial states, gestures and relabelling, as arrays over worlds."""

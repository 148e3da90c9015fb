"""A policy on an arm: the interface of arms, what keeps them safe, a simulated twin, and the environment between."""

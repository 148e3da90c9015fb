"""Collection, evaluation, instruction ablations and video."""

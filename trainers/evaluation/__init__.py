"""Evaluation of policies: success, chains, instruction ablations and videos."""

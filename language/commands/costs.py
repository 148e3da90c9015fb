"""The score: costs of readings and of what they denote, in one table. The reading of the least cost is chosen.

The unit is arbitrary. Costs of readings need no scene; costs of referents and outcomes compare a reading with the scene.
"""

from __future__ import annotations

# Readings.
SKIPPED = {"unknown": 2.2, "function": 1.3, "content": 4.0}  # a word that is left out
RELATION = 0.10  # each relation that is attached to a phrase
ODD_PREPOSITION = 0.6  # such as "in the cube"
NO_NOUN = 0.8  # "the blue"
REGION_WITHOUT_PREPOSITION = 1.0  # "on red cube left edge"
NO_VERB = 1.0
NO_OBJECT = 0.5  # "pick up the cube and place on the red one"
INVERTED = 0.8  # "place on the red cube the blue one"
PLACE_TWICE = 0.7  # two places joined without "and"
STEP_WITHOUT_JOIN = 1.0

# Outcomes.
EMPTY = 8.0  # a phrase that nothing fits, while the readings are pruned
NOT_CARRIED_OUT = 50.0  # a reading that no candidate makes possible
CLOSE = 0.35  # readings this close in cost with other outcomes are asked about

# Referents.
TOP_OF_STACK = 0.8  # "the cube on the tower" for the tower's own top
NOT_DIRECTLY = 1.0  # above, with something between
NOT_QUITE_THERE = 1.5  # nearest to a corner that nothing is in
ON_COVERED = 3.0  # on top of what stands on the anchor
OCCUPIED = 0.6  # beside an anchor, but on top of something else

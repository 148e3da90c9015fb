"""The score: costs of readings and of what they denote, in one table. The reading of the least cost is chosen.

The unit is arbitrary. Costs of readings need no scene; costs of referents and outcomes compare a reading with the
scene.
"""

from __future__ import annotations

# Readings.
SKIPPED = {"unknown": 2.2, "function": 1.3, "content": 4.0, "color": 8.0}  # a word that is left out
RELATION = 0.10  # each relation that is attached to a phrase
ODD_PREPOSITION = 0.6  # such as "in the cube"
NO_NOUN = 0.8  # "the blue"
REGION_WITHOUT_PREPOSITION = 1.0  # "on red cube left edge"
TAKEN_SOMEWHERE = 1.5  # "take X" with a place, which is more likely a part of the phrase X
POINTED = -0.05  # "this cube" with a gesture: more likely the cube that it shows
UPPER_SIDE = 0.05  # "the top one" as the far one, not the one on top
UNUSED_GESTURE = 12.0  # a gesture without a word for it, if another reading has one
NO_VERB = 1.0
NO_VERB_BUT_PLACE = 1.4  # "the red cube on the blue one": more likely a thing than a command
VAGUE = 2.5  # "the one next to it" as a command
NEVER = 3.0  # a verb of what no robot here can do
NO_OBJECT = 0.5  # "pick up the cube and place on the red one"
NEAREST_PLACE = 1.5  # "nearest to" as a place; it mostly says which thing
TOPIC_LEFT = 2.0  # "the cube next to the red one, then the blue one": nothing is said of the first
TOPIC_TAKEN = 2.0  # "the cube next to the red one, lift it": rather the place says which one, not where it goes
BARE_DIRECTION = 0.3  # "the cube left"
WAY_FOR_SIDE = 1.0  # "put the cubes on | the left": rather the place on the left than the way there
BARE_PLACE = 0.3  # "in" for the container that was spoken of, "back" for the former place
LISTED = 0.5  # "the red cube and the blue one" as one object
PLACED_LIST = 0.7  # "the cube on the red one and the blue one | on the gray one": rather two commands
PARTICIPLE = 0.9  # "the drawer closed" as a command
FAR_SIDE = 0.4  # "far left" as two sides
ANOTHER_KIND = 0.3  # "put the cube on the blue one": more likely a cube, too
ON_TOP_OF_REGION = 0.7  # "on top | right corner"
SUPERLATIVE_ALONE = 1.6  # "the top" as a thing
INVERTED = 0.8  # "place on the red cube the blue one"
PLACE_TWICE = 0.7  # two places joined without "and"
CONTRAST = 0.4  # "but in the fridge" after what is not to be done says what is
STEP_WITHOUT_JOIN = 1.0  # a further step without a word such as "then"

SPELLING = 1.2  # of one wrong letter

# Outcomes.
EMPTY = 8.0  # a phrase that nothing fits, while the readings are pruned
CLOSE = 0.12  # readings with other outcomes that cost at most this much more lead to a question

# Referents.
SEE_THROUGH = 0.5  # a see-through thing that the words do not call see-through
FIXED_UNNAMED = 0.3  # "touch red" of a device or a container: rather a cube
ELEVATED = 0.2  # an anchor "the red block" that stands on another block
ALL_OF_PLURAL = -0.3  # all things for "the red cubes", rather than one of them
TOP_OF_STACK = 0.8  # "the cube on the tower" for the tower's own top
NOT_DIRECTLY = 1.0  # above, with something between
NOT_QUITE_THERE = 1.5  # the thing nearest to a corner, if nothing is in the corner
ONLY_USABLE = 0.3  # the best among the things that can be taken or bear another one, not among all
OCCUPIED = 0.6  # beside an anchor, but on top of something else

# Plans.
IMPLIED = 0.4  # a step that nobody asked for
NO_CHANGE = 4.0  # the thing stands there already
ANOTHER_OBJECT = 0.6  # a further step moves something else
NOT_BELOW = 0.2  # the held thing goes elsewhere than straight down
OF_ANOTHER_DEVICE = 0.4  # a verb that is said of another device
ANOTHER_BARE = 6.0  # the verb again for a thing that is named by neither noun nor colour
MOVED_TWICE = 2.0  # the same thing is put down by two steps


# Outcomes.
FAR_BETTER = 3.0  # a reading that fails is reported if it is this much cheaper than any that can be carried out
BETTER = 0.7  # the same on a table, of a reading with a length that uses every word
LIKELIER = 1.0  # a reading that uses all words and is impossible is reported if it is this much cheaper
TOO_MUCH = 7.5  # a reading that costs more leads to a question
DOUBT = 12.0  # cost that lowers the confidence by a factor of e

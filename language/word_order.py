"""The order of the words in the vocabulary, from which their token ids follow.

Word embeddings of trained policies are stored by id, so an id never changes: append new words at the end, and keep
words that the grammar no longer uses. Words of the registries that are missing here get the ids after these, in the
registries' order.
"""

from __future__ import annotations

_WORDS = """
    reach touch go to move for push shove pick and place it up put take rotate swipe along the line drag throw toss
    poke nudge press down on turn twist switch flip toggle grasp grab hold of get lift raise red green blue yellow
    orange purple violet cyan turquoise pink gray grey object one thing cube block box sphere ball cylinder tube tin
    button knob lever handle wheel dial small little tiny large big huge solid opaque transparent translucent
    leftmost left rightmost right nearest closest farthest furthest most distant highest topmost top lowest bottom
    largest biggest smallest littlest at in front before behind back above over below under underneath beneath near
    close next beside by from between that is which not isn't a an this here there same position as then after you
    once please first could can would now robot hey i want thanks thank no meant mean sorry actually but
    stack drawer fridge door open pull shut unstack off into out remove
    hand palm me give pass bring my
    sort gather collect every
    """

WORD_ORDER: tuple[str, ...] = tuple(_WORDS.split())

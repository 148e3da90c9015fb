"""Words and the things they name: colours, objects, relations, instructions that say themselves, a parser.

Knows no physics and no robots. Positions are in metres in the workspace frame: origin at the robot's base on
the table top, x away from the robot, y to the robot's left, z up.
"""

from language.colors import COLORS, RGBA, color_name, color_table, draw_colors, rgba
from language.errors import LanguageError, NothingFits, NotUnderstood, SeveralFit
from language.generator import KINDS, Describer
from language.grammar import parse
from language.grounding import ground, matches
from language.instruction import Instruction, ObjectPhrase, say
from language.objects import NOUNS, ROLES, Object, Scene
from language.relations import HOLDS, RELATIONS, Relation, relation, unregister
from language.templates import TEMPLATES
from language.tokenizer import Tokenizer

__all__ = [
    "COLORS",
    "HOLDS",
    "KINDS",
    "NOUNS",
    "RELATIONS",
    "RGBA",
    "ROLES",
    "TEMPLATES",
    "Describer",
    "Instruction",
    "LanguageError",
    "NotUnderstood",
    "NothingFits",
    "Object",
    "ObjectPhrase",
    "Relation",
    "Scene",
    "SeveralFit",
    "Tokenizer",
    "color_name",
    "color_table",
    "draw_colors",
    "ground",
    "matches",
    "parse",
    "relation",
    "rgba",
    "say",
    "unregister",
]

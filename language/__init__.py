"""The instruction language: colours, objects, spatial relations, instructions, a sentence generator and a parser.

The package uses neither physics nor robots. Positions are in metres in the workspace frame: origin at
the robot's base on the table top, x away from the robot, y to the robot's left, z up.

`Dialogue` and `interpret` are imported when they are first used: environments and policies need neither, so that
results of policies stay valid when only the understanding of what people type changes.
"""

from typing import TYPE_CHECKING, Any

from language.colors import COLORS, RGBA, SEE_THROUGH, Color, color_name, color_table, draw_colors, rgba
from language.describing import DEFAULT_KINDS, Describer, describe
from language.embedding import SentenceEmbedding
from language.errors import LanguageError, NothingFits, NotUnderstood, SeveralFit
from language.generator import KINDS
from language.grounding import ground, matches
from language.instruction import Chain, Command, Correction, Instruction, Meaning, ObjectPhrase, say
from language.lexicon import count
from language.meanings import Gesture
from language.objects import DEVICES, FITTINGS, HAND, NOUNS, ROLES, SHAPES, SIZES, Object, Scene
from language.outcomes import Answer, Outcome, Plan, Question, Refusal, Signal, Step
from language.placement import Layout, ObjectSpec, Placed, from_all, from_lists, from_pairs
from language.relations import (
    HOLDS,
    RELATIONS,
    SUPERLATIVES,
    Relation,
    Superlative,
    relation,
    superlative,
    unregister,
)
from language.splits import SPLITS, HeldOut, Split
from language.task_generation import GeneratedTask, generate_tasks, scene_after
from language.tokenizer import MAX_WORDS, Tokenizer
from language.understanding import GroundedStep, Understood, parse, revise, understand
from language.verbs import LIFTED, VERBS, Verb
from language.viewpoint import VIEWPOINTS, Viewpoint, whose_left
from language.wording import Wording
from language.world import Thing, WorldModel, board, table

if TYPE_CHECKING:
    from language.dialogue import Dialogue, interpret

__all__ = [
    "COLORS",
    "DEFAULT_KINDS",
    "DEVICES",
    "FITTINGS",
    "HAND",
    "HOLDS",
    "KINDS",
    "LIFTED",
    "MAX_WORDS",
    "NOUNS",
    "RELATIONS",
    "RGBA",
    "ROLES",
    "SEE_THROUGH",
    "SHAPES",
    "SIZES",
    "SPLITS",
    "SUPERLATIVES",
    "VERBS",
    "VIEWPOINTS",
    "Answer",
    "Chain",
    "Color",
    "Command",
    "Correction",
    "Describer",
    "Dialogue",
    "GeneratedTask",
    "Gesture",
    "GroundedStep",
    "HeldOut",
    "Instruction",
    "LanguageError",
    "Layout",
    "Meaning",
    "NotUnderstood",
    "NothingFits",
    "Object",
    "ObjectPhrase",
    "ObjectSpec",
    "Outcome",
    "Placed",
    "Plan",
    "Question",
    "Refusal",
    "Relation",
    "Scene",
    "SentenceEmbedding",
    "SeveralFit",
    "Signal",
    "Split",
    "Step",
    "Superlative",
    "Thing",
    "Tokenizer",
    "Understood",
    "Verb",
    "Viewpoint",
    "Wording",
    "WorldModel",
    "board",
    "color_name",
    "color_table",
    "count",
    "describe",
    "draw_colors",
    "from_all",
    "from_lists",
    "from_pairs",
    "generate_tasks",
    "ground",
    "interpret",
    "matches",
    "parse",
    "relation",
    "revise",
    "rgba",
    "say",
    "scene_after",
    "superlative",
    "table",
    "understand",
    "unregister",
    "whose_left",
]


def __getattr__(name: str) -> Any:
    if name in ("Dialogue", "interpret"):
        from language import dialogue

        return getattr(dialogue, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

"""The table of verbs: what each is called, what it acts on, what must hold before it and what holds after it.

Generator, parser, planner, the feasibility of instructions in a room, refusals and docs read it; no other module names
a verb. `VERBS` holds the verbs that can be said; `FURTHER` those that are only understood:

    "wave": Verb(("wave at {object}", "greet {object}"))

Nothing else is needed for a new verb; a further template or word is a further string.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from language.errors import LanguageError

OBJECT, GOAL = "{object}", "{goal}"  # slots of a template: the object's phrase, and the words for the place
BASE = "{base}"  # slot of a template: the phrase of the object that it is put on

POINTING = ("this", "that")  # with or without a noun; a gesture identifies the object
HERE = ("here", "there")  # the object at the place that a gesture shows
IT = "it"  # the object of the previous step
EVERY = "every"  # each object that the phrase fits, one after another

# Words before the object that marks a place; `say` uses the first. `here` and `there` stand without them.
PLACES = ("to the same position as", "to the position of", "at the position of", "to the place of", "to", "at")


class Act(Enum):
    """What a verb does to its object; the planner has one rule for each."""

    TOUCH = "the gripper goes to it"
    TAKE = "the gripper takes it"
    HOLD = "the gripper takes hold of it; of furniture, of its handle"
    CARRY = "it goes to the place that is said"
    LOWER = "what is held goes down"
    REMOVE = "it is taken from where it is"
    GIVE = "it goes onto the person's open hand"
    UNSTACK = "it is taken off what it stands on"
    OPERATE = "the device is moved to its other state"
    OPEN = "the container is opened"
    SHUT = "the container is closed"
    EMPTY = "what is in it goes onto the table"
    SWAP = "two things change places"
    BUILD = "things are stacked"
    GATHER = "things are put beside each other"
    STORE = "it goes into a container"
    TIDY = "everything goes where it belongs; nothing says where that is"
    IGNORE = "nothing is done"
    NEVER = "no robot here can do it"


@dataclass(frozen=True)
class Verb:
    """A verb.

    Args:
        templates: all are understood exactly; `say` uses the first whose slots are all filled.
        reward, networks: of the original system's training: the reward's name, and the number of networks.
        moves: whether the object is moved ("init"); otherwise the gripper goes to it ("goal").
        effect: the position of the moved object afterwards: "goal" (where the goal was), "on" (on top of the goal, a
            real object), "in" (in the goal, a fitting), "out" (no longer in it), "hand" (on the person's hand, which no
            template names), "up" (LIFTED higher) or "" (unchanged).
        takes_every: whether its object may be "every red cube".
        act: what the planner does.
        words: further phrases that are only understood, separated by commas; the planner lets the scene decide.
        spoken: further templates that a speech recogniser expects.
        noun: the device that it operates.
        need: what must hold in a room before it (`envs/tasks/feasible.py` computes each need); "": not done in rooms.
        pulls: what the verb does to a container that is its object without a place.

    Raises LanguageError for a template that lacks its slots, or has them in another order.
    """

    templates: tuple[str, ...] = ()
    reward: str = "distance"
    networks: int = 1
    moves: bool = False
    effect: str = ""
    takes_every: bool = False
    act: Act = Act.TOUCH
    words: str = ""
    spoken: tuple[str, ...] = ()
    noun: str = ""
    need: str = ""
    pulls: Act | None = None

    def __post_init__(self) -> None:
        for template in self.templates:
            before, _, behind = template.partition(OBJECT)
            if template.count(OBJECT) != 1 or has_goal(before) or behind.count(GOAL) + behind.count(BASE) > 1:
                raise LanguageError(
                    f"{template!r}: a template has one {OBJECT} and, if any, one {GOAL} or {BASE} after it"
                )

    @property
    def takes_goal(self) -> bool:
        """Whether a template has a goal."""
        return any(map(has_goal, self.templates))

    @property
    def goal_is_real(self) -> bool:
        """Whether its goal is a real object, not a target that only marks a place."""
        return self.effect in ("on", "in", "out")

    @property
    def needs_goal(self) -> bool:
        """Whether all templates have a goal."""
        return all(map(has_goal, self.templates))


def has_goal(template: str) -> bool:
    """Return whether the template has a slot for the goal."""
    return GOAL in template or BASE in template


LIFTED = 0.15  # metres by which a lifted object rises

VERBS: dict[str, Verb] = {
    "reach": Verb(
        ("reach {object}", "touch {object}", "go to {object}", "move to {object}", "reach for {object}"),
        act=Act.TOUCH,
        need="touchable",
        words=(
            "reach out for, reach out to, reach to, reach over to, tap, tap on, go near, go near to, go over to, go up "
            "to, "
            "get to, come to, head to, head for, move over to, move near, move near to, move close to, approach, "
            "point to, point at, point towards, point out, move your hand to, move your arm to, move your gripper to, "
            "move the gripper to, move the arm to, move the hand to, bring your hand to, bring your arm to, "
            "bring your gripper to, bring the gripper to, bring the arm to, bring the hand to, guide the gripper to, "
            "put your hand on, put your gripper on, put your finger on, lay your hand on, find, "
            "look for, look at, search for, show me, show us, show, locate, feel, contact, hover over, navigate to, "
            "drive to, close in on, walk to, walk over to, visit, make contact with, poke, prod, go and touch, "
            "over to, guide your hand to"
        ),
    ),
    "push": Verb(
        ("push {object} {goal}", "shove {object} {goal}"),
        moves=True,
        effect="goal",
        act=Act.CARRY,
        pulls=Act.SHUT,
        words="push, shove, nudge, slide, pushing, poke, scoot, swipe, sweep, bump, press, ease, roll over",
    ),
    "pick_and_place": Verb(
        (
            "pick {object} and place it {goal}",
            "pick up {object} and place it {goal}",
            "pick {object} up and place it {goal}",
            "pick {object} and put it {goal}",
            "pick up {object} and put it {goal}",
            "take {object} and put it {goal}",
            "put {object} {goal}",
            "place {object} {goal}",
            "move {object} {goal}",
        ),
        reward="pnp",
        networks=3,
        moves=True,
        effect="goal",
        act=Act.CARRY,
        need="marked",
        words=(
            "move, put, place, set, shift, transfer, stack, carry, lay, leave, position, relocate, transport, keep, "
            "insert, "
            "stick, bring, slide, drag, reposition, pile, add, load, hang, get, rest, stand, balance, put back, place "
            "back, return, displace, situate, locate, mount, fix, attach, deposit, rearrange, gather, collect, sort, "
            "park, pop, plonk, plop, plunk, chuck, dump, budge, tuck, slip, slot, stuff, shove, haul, tow, tug, steer, "
            "lead, "
            "guide, send, line up, align, arrange, settle, install, seat, pull, draw, sit, deliver, fill, ship, "
            "fit, pass, pack, scooch, jog, inch, shuffle, squeeze, bring over, move over, "
            "bring back, take back, get back, kick, space, stage, station, "
            "placed, putted, putting, placing, moving, moved"
        ),
        spoken=("put {object} {goal}", "move {object} {goal}", "put {object} on {base}"),
    ),
    "pick_and_rotate": Verb(
        (
            "pick {object} and rotate it {goal}",
            "pick {object} and rotate it",
            "pick up {object} and rotate it {goal}",
            "pick up {object} and rotate it",
            "rotate {object} {goal}",
            "rotate {object}",
        ),
        reward="pnprot",
        networks=3,
        moves=True,
        effect="goal",
        act=Act.OPERATE,
        words="rotate, turn around, turn round, spin around, spin",
    ),
    "swipe": Verb(
        ("swipe {object} along the line {goal}", "swipe {object} {goal}", "drag {object} along the line {goal}"),
        reward="pnpswipe",
        networks=3,
        moves=True,
        effect="goal",
        act=Act.CARRY,
    ),
    "throw": Verb(
        ("throw {object} {goal}", "toss {object} {goal}"),
        "throw",
        3,
        moves=True,
        effect="goal",
        act=Act.NEVER,
        words="throw, throw away, toss, toss away, hurl, fling, catapult",
    ),
    "poke": Verb(
        ("poke {object} {goal}", "poke {object}", "nudge {object} {goal}", "nudge {object}"),
        reward="poke",
        networks=3,
        moves=True,
        effect="goal",
        act=Act.CARRY,
    ),
    "stack": Verb(
        (
            "stack {object} on {base}",
            "stack {object} on top of {base}",
            "put {object} on top of {base}",
            "place {object} on top of {base}",
        ),
        reward="stack",
        networks=3,
        moves=True,
        effect="on",
        act=Act.CARRY,
        need="bearing",
    ),
    "press": Verb(
        ("press {object}", "press down on {object}"),
        "press",
        3,
        act=Act.OPERATE,
        noun="button",
        need="device",
        words=(
            "press, press on, push, push on, hit, push down on, push down, press down, press in, push in, click, click "
            "on, ring, "
            "punch, smash, whack, slap, bang, strike, squash, squeeze, give a push to, activate, trigger, actuate, "
            "operate, use, "
            "work, engage, start, depress, turn on, switch on, turn off, switch off, do, power on, enable"
        ),
    ),
    "turn": Verb(
        ("turn {object}", "twist {object}"),
        "turn",
        3,
        act=Act.OPERATE,
        noun="wheel",
        need="device",
        words=(
            "turn, twist, rotate, spin, crank, turn around, turn round, wind, swivel, revolve, dial, screw, unscrew, "
            "roll, adjust, "
            "rotate around, spin around, whirl, have a go at"
        ),
    ),
    "switch": Verb(
        ("switch {object}", "flip {object}", "toggle {object}"),
        "switch",
        3,
        act=Act.OPERATE,
        noun="lever",
        need="device",
        pulls=Act.OPEN,
        words=(
            "flip over, pull, pull on, pull down, throw, toggle, crank, tug, tug on, yank, yank on, flick, change "
            "over, push over, move over, "
            "throw over, reverse, pull back, shift, tip, tilt, pull at, draw"
        ),
    ),
    "grasp": Verb(
        ("grasp {object}", "grab {object}", "take hold of {object}", "take {object}", "get {object}"),
        "grasp",
        1,
        act=Act.HOLD,
        need="loose",
        words=(
            "grab, grasp, take hold of, grab hold of, get hold of, get a hold of, get a grip on, hold, hold on to, "
            "hold onto, grip, seize, clutch, catch, catch hold of, clasp, keep hold of, snatch, get ahold of, nab, "
            "pinch, clamp, hang on to"
        ),
    ),
    "lift": Verb(
        (
            "lift {object}",
            "lift up {object}",
            "lift {object} up",
            "raise {object}",
            "pick up {object}",
            "pick {object}",
            "pick {object} up",
        ),
        reward="lift",
        networks=3,
        moves=True,
        effect="up",
        act=Act.TAKE,
        need="loose",
        words=(
            "take, pick, pickup, picking, picking up, taking, grabbing, get, lift, raise, collect, select, take up, "
            "pull up, choose, pick out, "
            "elevate, hoist, heave, retrieve, scoop up, scoop, grab up, gather up, relieve me of, "
            "get up, hold up, bring up, acquire, obtain, accept, receive, pluck, lift off"
        ),
    ),
    "open": Verb(
        ("open {object}", "pull {object} open"),
        "open",
        3,
        act=Act.OPEN,
        need="shut",
        words=(
            "open up, open, pull open, pull out, slide open, slide out, unlock, unseal, uncover, look inside, look "
            "into, look in, "
            "check inside, check in, peek into, peek inside, have a look inside, have a look in, see inside, see into, "
            "take a look inside, "
            "take a look in, get ready, prepare, lift open, swing open, draw open, crack open, undo, unclose, have a "
            "look into, "
            "reopen, show the inside of, show me the inside of, make accessible, expose, reveal"
        ),
    ),
    "close": Verb(
        ("close {object}", "shut {object}"),
        "close",
        3,
        act=Act.SHUT,
        need="wide",
        words=(
            "close, shut, close up, shut up, push shut, push closed, slide shut, slide closed, push back, slide in, "
            "slide back, "
            "push in, push back in, slide back in, seal, lock, close off, pull shut, swing shut, put shut, pull "
            "closed, cover, reclose, secure"
        ),
    ),
    "put_in": Verb(
        ("put {object} in {base}", "put {object} into {base}", "place {object} in {base}"),
        reward="pnp",
        networks=3,
        moves=True,
        effect="in",
        act=Act.STORE,
        need="room inside",
        words=(
            "put away, store, stow, stow away, stash, stash away, store away, tidy away, pack away, tidy, file, hide, "
            "clear away, "
            "insert, put in, place in, drop in, pop in, tuck away, save, cool, chill, refrigerate, lock away, "
            "put inside, shelve"
        ),
        spoken=("put {object} inside {base}",),
    ),
    "take_out": Verb(
        ("take {object} out of {base}", "remove {object} from {base}"),
        "pnp",
        3,
        moves=True,
        effect="out",
        act=Act.REMOVE,
        need="inside",
        words=(
            "remove, take away, take out, get out, pull out, bring out, lift out, fetch out, pick out, unload, "
            "extract, "
            "take off, lift off, get off, clear off, withdraw, evacuate, evict, expel, eject, banish, oust, rescue, "
            "extricate, take away from, move out, fish out, dig out, "
            "grab out, "
            "come out, unpack, put out, carry out, clear"
        ),
    ),
    "hand_over": Verb(
        (
            "hand me {object}",
            "give me {object}",
            "pass me {object}",
            "bring me {object}",
            "hand {object} to me",
            "give {object} to me",
            "pass {object} to me",
            "bring {object} to me",
            "hand over {object}",
            "bring {object} over to me",
            "put {object} in my hand",
            "take {object} and put it in my hand",
        ),
        reward="pnp",
        networks=3,
        moves=True,
        effect="hand",
        act=Act.GIVE,
        need="empty hand",
        words=(
            "get me, fetch me, i want, i need, i would like, i would love, i would like to have, i want to have, i "
            "need to have, i would love to have, give, bring us, give us, hand us, pass us, hand, pass, bring over, "
            "fetch, bring, deliver, pass over, give over, hand back, give back, pass along, pass on, bring here, fetch "
            "here, "
            "gimme, lend me, offer me, serve me, send me, grab me, get us, find me, let me have, can i have, could i "
            "have, may i have, "
            "could i get, can i get, may i get, trouble you for, i could use, i could do with, present me with, "
            "present me, supply me with, "
            "provide me with, i am after, i fancy, i am in need of, i require, we need, we want, toss me, throw me, "
            "slip me, pick me, hand out, "
            "take me, carry me, drop me, want, show me and give me, give back to me, i will have, i will take, get for "
            "me, surrender, return, present, offer, submit"
        ),
    ),
    "unstack": Verb(
        ("unstack {object}", "take {object} down", "take {object} off the stack"),
        "unstack",
        3,
        moves=True,
        act=Act.UNSTACK,
        need="stacked",
        words=(
            "unstack, unpile, take down, bring down, get down, lift down, destack, collapse, disassemble, dismantle, "
            "take apart, knock down, break up, pull apart, undo"
        ),
    ),
    "sort": Verb(
        (
            "sort {object} to {base}",
            "gather {object} at {base}",
            "collect {object} at {base}",
            "bring {object} to {base}",
        ),
        reward="pnp",
        networks=3,
        moves=True,
        effect="goal",
        takes_every=True,
        act=Act.CARRY,
    ),
}

FURTHER: dict[str, Verb] = {  # only understood
    "put_down": Verb(
        act=Act.LOWER,
        words=(
            "drop, release, let go, let go of, put down, place down, lower, set down, drop down, lay down, let fall, "
            "ungrasp, "
            "unhand, drop off, deposit, let down, let loose, rest down, get rid of, set free, drop it down, open your "
            "hand, "
            "open your gripper, open the gripper, open your fingers, bring down"
        ),
        spoken=("put down {object}", "put {object} down", "drop {object}", "release {object}"),
    ),
    "empty": Verb(
        act=Act.EMPTY, words="empty, clear out, empty out, clean out, unload, remove everything from, vacate"
    ),
    "swap": Verb(
        act=Act.SWAP,
        words=(
            "swap, exchange, switch, trade, interchange, swap places of, swap the places of, swap the positions of, "
            "swap positions of, "
            "exchange places of, exchange the places of, exchange the positions of, exchange the position of, switch "
            "places of, "
            "switch the places of, switch the positions of, switch positions of, switch around, swap around, swap "
            "over, "
            "change places of, change the places of, change the positions of, trade places of, replace, substitute, "
            "switch over, reverse"
        ),
    ),
    "build": Verb(
        act=Act.BUILD,
        words=(
            "build, make, create, form, construct, erect, assemble, stack, stack up, pile up, pile, put together, set "
            "up, do, give me, "
            "i want, i need, we need, i would like, have"
        ),
    ),
    "gather": Verb(act=Act.GATHER, words="group together, gather together, put side by side, place side by side"),
    "tidy_up": Verb(
        act=Act.TIDY,
        words=(
            "tidy up, tidy, clean up, clear up, clear, sort, sort out, arrange, organize, organise, clean, order, line "
            "up, "
            "put in order, put in a row, spread out, spread, group, make room on, clear off, straighten up, "
            "shuffle, "
            "put away, mix up, distribute"
        ),
    ),
    "never_done": Verb(
        act=Act.NEVER,
        words=(
            "sing, dance, pour, cook, jump, cut, break, crush, fold, wash, dry, paint, draw, write, read, eat, drink, "
            "fly, "
            "walk, run, tip over, knock over, knock off, turn over, turn upside down, topple, topple over, flip upside "
            "down, lick, bake, fry, brew, "
            "boil, heat, heat up, warm, warm up, weigh, count out, juggle, kiss, hug, call, phone, play, buy, order, "
            "sweep, vacuum, mop, wipe, polish, scrub, "
            "dust, iron, water, feed, stir, mix, chop, slice, peel, unwrap, burn, melt, freeze, glue, tie, weld, "
            "drill, hammer, "
            "saw, unscrew, kick, smash, destroy, stand up, sit down, wave, clap, laugh, cry, swallow, wear, repair, "
            "dress, drive, swim, climb, photograph, film, record, print, email, text, google, translate, multiply, "
            "tip, lay on its side, wobble, shake, "
            "turn on its side, put on its side, flip on its side, stand upright, stand on end, flatten, bend, stretch, "
            "squash, teleport, levitate"
        ),
    ),
}
KNOWN: dict[str, Verb] = VERBS | FURTHER

# The verbs of a room, in the order in which instructions are drawn.
_ORDER = "reach grasp lift pick_and_place stack unstack open close put_in take_out press switch turn hand_over"
ROOM = tuple(_ORDER.split())
DEVICE_VERBS = {name: VERBS[name].noun for name in ROOM if VERBS[name].noun}  # each with the noun of its device
HANDING = next(name for name, verb in VERBS.items() if verb.effect == "hand")
OPERATED = tuple(name for name, verb in VERBS.items() if verb.act in (Act.OPEN, Act.SHUT))  # done to fittings
CARRIES = tuple(name for name in ROOM if VERBS[name].effect in ("goal", "on", "in", "hand"))  # for what is held
PLACING = next(name for name in ROOM if VERBS[name].effect == "goal")  # brings something to a place on the table
SORTING = next(name for name, verb in VERBS.items() if verb.takes_every)
CHAINED = ("reach", "push", "pick_and_place", "swipe", "throw", "lift")  # the verbs of generated chains


def doing(act: Act, noun: str = "") -> str:
    """Return the first verb with this act, and for this device."""
    return next(name for name, verb in KNOWN.items() if verb.act is act and (not noun or verb.noun == noun))


def bringing(effect: str) -> str:
    """Return the verb of a room with this effect on what is moved."""
    return next(name for name in ROOM if VERBS[name].effect == effect)


OPENINGS = ("please", "first", "could you", "can you", "would you", "now", "robot", "hey", "i want you to")
CLOSINGS = ("please", "now", "thanks", "thank you")
THEN = ("then", "and then", "and", "after that")  # between steps; `say` uses the first
AFTER = ("after you", "once you")  # before the step that is executed first
NO = ("no", "no i meant", "i meant", "no i mean", "i mean", "sorry", "actually")  # begins a correction
NOT = ("not", "no not")  # begins a correction that rejects an object
BUT = ("but", "i meant", "i mean")  # optional before the object that is meant instead

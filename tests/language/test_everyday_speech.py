"""What people of all kinds say in a room: conditions, dislocated names, wishes for others, telegrams, corrections."""

import pytest

from language import Answer, Dialogue, Object, Plan, Question, Refusal, Scene, Signal, table
from tests.helpers.room_cases import outcome_of
from tests.helpers.sets_room import FACTS, NAMES, done, room, said


def place(sentence, state="A"):
    """Where the last step puts its thing, metres."""
    outcome = said(sentence, state)
    assert isinstance(outcome, Plan), outcome
    return outcome.steps[-1].place


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("Unless the drawer is already shut, shut it.", "B", ["close drawer"]),
        ("Only if the drawer is empty should the gray one go in it.", "B", ["put_in gray drawer"]),
        ("When the fridge is open you close it, when it's closed you leave it alone.", "F", ["close fridge"]),
        ("press the button unless somebody already has", "A", ["press button"]),
        ("Should the lever be on, switch it off.", "A", ["switch lever"]),
        ("If you wouldn't mind, and only if it isn't already shut, close the drawer for me.", "B", ["close drawer"]),
        ("after the button has been pressed, open the drawer", "A", ["press button", "open drawer"]),
        ("close the drawer last; before that, turn the wheel", "B", ["turn wheel", "close drawer"]),
    ],
)
def test_conditions_and_orders_are_understood_in_any_order_of_words(sentence, state, steps):
    assert done(sentence, state) == steps


def test_what_somebody_has_done_already_is_not_done_again():
    assert isinstance(said("open the drawer unless somebody already has", "B"), Answer)


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("the yellow, that's got to be kept cold", "F", ["put_in yellow fridge"]),
        (
            "Since the fridge is open anyway, stick the cyan in it and then shut it.",
            "F",
            ["put_in cyan fridge", "close fridge"],
        ),
        (
            "the drawer's open already, so the blue could go in there I suppose, yes, do that",
            "B",
            ["put_in blue drawer"],
        ),
        ("Because people keep walking into it, that drawer needs closing.", "B", ["close drawer"]),
        ("Never mind the drawer, it's the fridge I want opened.", "A", ["open fridge"]),
        ("There shouldn't be anything in the fridge.", "I", ["pick_and_place yellow"]),
        ("Stock the fridge with whichever cube is closest to it.", "F", ["put_in red fridge"]),
        ("Of cyan and gray, whichever is nearer the yellow, put it on the yellow", "A", ["stack cyan yellow"]),
        ("Tidy up the fridge and the drawer, they're both hanging open", "BF", ["close fridge", "close drawer"]),
        (
            "What's lying in the drawer belongs in the fridge, and the other way around.",
            "I",
            ["pick_and_place red", "put_in yellow drawer", "put_in red fridge"],
        ),
    ],
)
def test_a_name_that_is_said_first_or_as_a_clause_is_what_it_means(sentence, state, steps):
    assert done(sentence, state) == steps


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("don't give her the red, she'd rather have the yellow", "A", ["hand_over yellow hand"]),
        ("The red one's for her, sorry, the blue one's for her.", "A", ["hand_over blue hand"]),
        ("Here's my hand; which cube you give me I don't mind.", "A", ["hand_over yellow hand"]),
        ("close both of them, well, no, only the fridge", "BF", ["close fridge"]),
        (
            "fridge open yellow out fridge closed chop chop",
            "K",
            ["open fridge", "pick_and_place yellow", "close fridge"],
        ),
        ("open the fridge, sorry, meant the drawer", "A", ["open drawer"]),
        ("take the blue, wait, not the blue, I mean the gray", "A", ["lift gray"]),
        ("Not red, not blue: orange. Lift.", "A", ["lift orange"]),
        ("drawer. open. red. out.", "K", ["open drawer", "take_out red drawer"]),
        ("i bet you cant open the fridge", "A", ["open fridge"]),
        ("what if we put the cyan where the see-through one is... yes, let's", "A", ["pick_and_place cyan target"]),
    ],
)
def test_wishes_corrections_and_telegrams_are_carried_out(sentence, state, steps):
    assert done(sentence, state) == steps


def test_what_takes_the_place_in_the_hand_is_handed_over():
    steps = done("I'd like the orange taken out of my hand and the cyan put there instead.", "H")
    assert steps[-1] == "hand_over cyan hand"


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("the drawer shouldn't be open", "B", ["close drawer"]),
        ("the fridge must not stay open", "F", ["close fridge"]),
        ("the drawer should not be shut", "A", ["open drawer"]),
        ("neither the drawer nor the fridge should be open", "BF", ["close drawer", "close fridge"]),
        ("red is meant to go in the drawer", "B", ["put_in red drawer"]),
        ("the drawer ought to contain the red cube", "B", ["put_in red drawer"]),
        ("the blue cube should have the yellow one on top of it", "A", ["stack yellow blue"]),
        ("the blue box belongs in the drawer", "B", ["put_in blue drawer"]),
        ("I want the gray cube lying in a closed drawer", "B", ["put_in gray drawer", "close drawer"]),
        (
            "both containers should be emptied and closed",
            "I",
            ["pick_and_place yellow", "pick_and_place red", "close fridge", "close drawer"],
        ),
    ],
)
def test_what_is_said_to_be_so_is_made_so(sentence, state, steps):
    assert done(sentence, state) == steps


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("fetch the red cube from the drawer and stack it on cyan", "I", ["stack red cyan"]),
        ("reach into the drawer and take out the red cube", "I", ["take_out red drawer"]),
        ("close the drawer once the red cube is in", "A", ["open drawer", "put_in red drawer", "close drawer"]),
        (
            "blue needs to be in the drawer, so open it first and close it once the cube is in",
            "A",
            ["open drawer", "put_in blue drawer", "close drawer"],
        ),
        ("open the drawer then the fridge", "A", ["open drawer", "open fridge"]),
        (
            "operate all three devices, first the lever, then the button, then the wheel",
            "A",
            ["switch lever", "press button", "turn wheel"],
        ),
        ("press the button, then give the wheel two turns", "A", ["press button", "turn wheel", "turn wheel"]),
        ("raise the orange cube from the table and keep it in the gripper", "A", ["lift orange"]),
        ("touch two cubes, any will do", "A", ["reach yellow", "reach orange"]),
        ("hand my colleague the cyan one", "A", ["hand_over cyan hand"]),
        ("take what I'm holding and put it on the table", "H", ["pick_and_place orange"]),
    ],
)
def test_each_deed_is_done_once_and_in_order(sentence, state, steps):
    assert done(sentence, state) == steps


def test_two_cubes_that_shall_be_touched_are_not_moved():
    assert isinstance(said("touch two cubes"), Question)


def test_a_cube_with_another_at_its_side_stays_where_it_is():
    x, y = place("yellow should have cyan directly on its left")
    assert x == pytest.approx(0.3375, abs=0.005)
    assert 0.05 < y - 0.0145 < 0.1


@pytest.mark.parametrize(
    ("sentence", "side"),
    [
        ("put the orange, the gray and the cyan cube in a row on the left side of the table", 1),
        ("line up orange, gray and cyan on the left", 1),
        ("put the yellow, the red and the cyan cube in a line on the right side of the table", -1),
    ],
)
def test_a_row_at_a_side_of_the_table_is_a_straight_one_there(sentence, side):
    outcome = said(sentence)
    assert isinstance(outcome, Plan)
    places = [step.place for step in outcome.steps if step.place is not None]
    (x0, y0), (x1, y1), (x2, y2) = places
    assert all(y * side > 0 for _, y in places)
    assert (x1 - x0, y1 - y0) == pytest.approx((x2 - x1, y2 - y1), abs=1e-6)


@pytest.mark.parametrize(
    ("question", "state", "told", "not_told"),
    [
        (
            "which cubes are on the right side of the table?",
            "A",
            ("blue", "orange cube is on the table"),
            "red cube is",
        ),
        ("is the orange cube on the right?", "A", ("Yes",), "No"),
        ("so which cube is furthest to the right now?", "A", ("The blue cube",), "cyan"),
        ("which cubes are in the middle?", "A", ("yellow cube is", "cyan cube is", "gray cube is"), "red cube is"),
        ("what have we got in the drawer and in the fridge?", "I", ("red cube", "yellow cube"), "Nothing"),
        ("is there anything in the drawer or the fridge?", "I", ("Yes", "red cube", "yellow cube"), "No"),
        ("is there anything in the drawer or the fridge?", "A", ("No",), "Yes"),
        ("is the red cube in the drawer or on the table?", "A", ("on the table",), "drawer"),
        ("are there any stacks on the table?", "S", ("Yes", "blue cube", "cyan cube"), "No"),
        ("are there any stacks on the table?", "A", ("No",), "Yes"),
        ("which cube is the lower one?", "S", ("The cyan cube",), "None"),
        ("which one is the upper one?", "S", ("blue cube",), "None"),
    ],
)
def test_what_is_asked_of_several_places_or_things_is_told_of_each(question, state, told, not_told):
    outcome = said(question, state)
    assert isinstance(outcome, Answer)
    assert all(words in outcome.text for words in told)
    assert not_told not in outcome.text


def turns(*sentences, state="A"):
    """The outcome of the last of some turns, and what its steps do with what."""
    outcome = outcome_of(" / ".join(sentences), room(FACTS[state]))
    return outcome, [f"{step.verb} {NAMES[step.object]}" for step in outcome.steps]


@pytest.mark.parametrize(
    ("sentences", "state", "steps"),
    [
        (("has the button been pressed yet?", "then do that now"), "A", ["press button"]),
        (("is the drawer open?", "do that then"), "A", ["open drawer"]),
        (("has the drawer been closed already?", "then do it"), "B", ["close drawer"]),
        (("which container is still empty?", "then it goes in the blue one"), "D", ["put_in red"]),
        (("work the lever", "and take that last one back"), "A", ["switch lever"]),
        (("pick up the gray cube and keep it in the air",), "A", ["lift gray"]),
        (("get the yellow cube up off the table",), "A", ["lift yellow"]),
    ],
)
def test_a_turn_takes_up_what_was_asked_or_done_before_it(sentences, state, steps):
    assert turns(*sentences, state=state)[1] == steps


def test_lifting_is_undone():
    outcome, steps = turns("lift red up", "undo the lifting")
    assert isinstance(outcome, Signal)
    assert steps == ["pick_and_place red"]


def test_a_number_is_corrected():
    assert place("Shift cyan 3 cm to the left, no, make that four")[1] == pytest.approx(0.0516 + 0.04, abs=0.005)


def test_a_place_on_two_sides_is_on_both():
    x, y = place("the blue belongs behind the orange and to its left")
    assert x > 0.3633 + 0.01
    assert y > -0.1412 + 0.02


def test_your_side_is_the_robots():
    assert place("could the gray one come a bit nearer to your side?")[0] < 0.4467
    assert place("Shove the blue five centimetres your way")[0] == pytest.approx(0.4452 - 0.05, abs=0.005)


def test_as_far_as_it_goes_is_to_the_edge():
    assert place("scoot the yellow away from you as far as it'll go")[0] > 0.42


@pytest.mark.parametrize(
    ("sentence", "state", "words"),
    [
        ("Has he got something in his hand?", "H", "Yes: the orange cube"),
        ("what has she got in her hand?", "H", "The orange cube is in your hand"),
        ("What's the gap from the orange cube to the blue one?", "A", "10 cm"),
        ("How many cube is staying left of yellow cube?", "A", "two"),
        ("How many cubes have we got out on the table at the moment?", "A", "six"),
        ("the cube that has another one on it: which is it?", "S", "cyan"),
        ("Anything red here that isn't a cube?", "A", "wheel"),
        (
            "My eyes are not what they were, dear: which of these is the yellow one?",
            "A",
            "The yellow cube is on the table",
        ),
        ("Might you tell me, young man, what it is that you are able to do?", "A", "pick things up"),
    ],
)
def test_questions_are_answered_in_many_wordings(sentence, state, words):
    outcome = said(sentence, state)
    assert isinstance(outcome, Answer)
    assert words in outcome.text


def test_two_of_many_are_asked_about_and_never_all_of_them_moved():
    assert isinstance(said("move two blocks to the left side"), Question)
    assert len(done("any two blocks to the left side")) == 2


def test_all_are_not_put_away_in_part():
    assert not isinstance(said("put all the cubes away"), Plan)


def test_a_second_thing_on_top_is_on_what_was_just_put_there():
    assert isinstance(said("put yellow on cyan and blue on top"), Refusal)


def test_a_button_is_not_pressed_for_a_cube_that_shall_be_turned():
    assert isinstance(said("turn the gray one through ninety degrees"), Refusal)


def test_the_choice_is_not_left_to_the_robot_without_a_question():
    assert isinstance(said("Surprise me!"), Question)


def test_hold_it_right_there_stops():
    assert isinstance(said("whoa whoa whoa hold it right there"), Signal)


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("grab the orange cube and put it away in the drawer for me", "B", ["put_in orange drawer"]),
        ("put the blue one in the drawer, so they match", "B", ["put_in blue drawer"]),
        ("put the yellow block in the fridge before it goes bad, haha", "F", ["put_in yellow fridge"]),
        ("close the drawer and uh the fridge too while you're at it", "BF", ["close drawer", "close fridge"]),
    ],
)
def test_whom_it_is_for_and_why_adds_no_step(sentence, state, steps):
    assert done(sentence, state) == steps


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("somebody left the fridge open again, could you shut it?", "F", ["close fridge"]),
        ("my daughter hid her red block in the drawer. can you get it and give it to me?", "I", ["hand_over red hand"]),
        ("you see the cube behind the yellow one? stack it on the red one", "A", ["stack cyan red"]),
        ("there is a cube behind the yellow one, put it on the red one", "A", ["stack cyan red"]),
        ("i've got my hand out, just lay the yellow cube in it", "A", ["hand_over yellow hand"]),
    ],
)
def test_what_is_told_first_is_what_it_means(sentence, state, steps):
    assert [step for step in done(sentence, state) if not step.startswith("take_out")] == steps


def test_who_shall_not_have_something_gets_nothing():
    assert not isinstance(said("my brother wants the red cube. don't give it to him"), Plan)


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("open the fridge and put the cube closest to it inside", "A", ["open fridge", "put_in red fridge"]),
        ("put the cube closest to the drawer inside it", "B", ["put_in blue drawer"]),
        ("check the fridge and take out whatever is in there", "I", ["take_out yellow fridge"]),
        ("tap the button", "A", ["press button"]),
        ("perch the red cube on the blue one", "A", ["stack red blue"]),
        ("pick up the red cube, wait, actually put the red one on the blue one", "A", ["stack red blue"]),
        ("pick up the cube uh the red cube", "A", ["lift red"]),
        (
            "put the yellow cube on the cyan one, then pick up the cube to the right of it",
            "A",
            ["stack yellow cyan", "lift gray"],
        ),
    ],
)
def test_it_and_there_mean_what_the_same_sentence_named(sentence, state, steps):
    assert done(sentence, state) == steps


def test_the_outermost_one_that_is_moved_is_a_loose_thing():
    assert done("move the rightmost one over to the left side of the table") == ["pick_and_place blue"]


def test_what_is_asked_first_is_done_if_it_can_be():
    steps = done("can you open the drawer? if so do it and put the red cube in it")
    assert steps == ["open drawer", "put_in red drawer"]


def test_many_things_that_shall_go_away_need_a_place():
    outcome = said("put all the cubes away")
    assert isinstance(outcome, Question)
    assert "where" in outcome.text


def test_nothing_goes_on_itself():
    assert said("stack the red cube on itself").text.startswith("nothing goes on")


@pytest.mark.parametrize(
    ("sentence", "steps"),
    [
        ("Please fetch the thing from the drawer for Paul", ["hand_over red hand"]),
        (
            "bring me the cyan block, please, Maria needs it for her picture.",
            ["hand_over cyan hand"],
        ),
        ("Could you kindly put Sophie's blue block in the drawer?", ["put_in blue drawer"]),
        ("Anna asked for it: press the gray button, please", ["press button"]),
    ],
)
def test_names_of_people_say_nothing_about_the_scene(sentence, steps):
    state = "I" if "drawer for" in sentence else "B"
    assert [step for step in done(sentence, state) if not step.startswith("take_out")] == steps


def test_what_people_ask_for_others_is_answered():
    assert isinstance(said("Grandpa asked where the red cube is"), Answer)


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("Turn a little the wheel", "A", ["turn wheel"]),
        ("Press one time the button that is gray", "A", ["press button"]),
        ("Bring out what is laying in the fridge", "I", ["hand_over yellow hand"]),
        ("the drawer should be closed with the gray block inside", "B", ["put_in gray drawer", "close drawer"]),
        ("The cyan block should not have anything on top of it.", "S", ["pick_and_place blue"]),
        ("Pick the blue block nearest to the drawer and drop it in", "B", ["put_in blue drawer"]),
        ("be careful and press the button", "A", ["press button"]),
        (
            "the fridge has been open for ages and the milk will go bad, so please shut it",
            "F",
            ["close fridge"],
        ),
    ],
)
def test_what_people_say_in_their_own_english_is_done(sentence, state, steps):
    assert done(sentence, state) == steps


def test_why_a_thing_cannot_go_so_far_is_the_reach_and_not_the_verb():
    assert "my reach ends after 1 cm" in said("shift the blue cube 20 cm to the right").text


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("Captain, close the drawer", "B", ["close drawer"]),
        ("give me the orange one, chief", "A", ["hand_over orange hand"]),
        ("yummy cookies! close the fridge", "F", ["close fridge"]),
        ("please shut the fridge, it is late and we go home now", "F", ["close fridge"]),
        ("put the blue one where the transparent cube is", "A", ["pick_and_place blue target"]),
        ("aight, press the button", "A", ["press button"]),
        ("close the drawer and then tell me if it is closed", "B", ["close drawer"]),
        ("give the wheel a little turn, I like to see it move", "A", ["turn wheel"]),
        ("which way does the wheel turn? no, don't tell me, just turn it", "A", ["turn wheel"]),
        ("do this three times: switch the lever", "A", ["switch lever"] * 3),
    ],
)
def test_calls_and_cries_beside_a_command_change_nothing(sentence, state, steps):
    assert done(sentence, state) == steps


def test_a_corner_that_is_told_in_two_parts_is_one_place():
    x, y = place("put the cyan cube in the right corner, the one closest to you")
    assert x < 0.35
    assert y < -0.15


@pytest.mark.parametrize(
    ("sentence", "state", "told"),
    [
        ("drawer status?", "B", "drawer is open"),
        ("how is the fridge?", "I", "yellow cube is in the red fridge"),
        ("what state is the lever in?", "A", "lever is down"),
        ("wheel position?", "A", "wheel"),
        ("what has the drawer got in it?", "I", "red cube is in the blue drawer"),
        ("what does the fridge hold?", "A", "Nothing is in the fridge"),
    ],
)
def test_a_state_is_told_whatever_it_is_called(sentence, state, told):
    outcome = said(sentence, state)
    assert isinstance(outcome, Answer), outcome
    assert told in outcome.text


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        ("take the blue one off the cyan one and put the gray one up there instead", "S", ["stack gray cyan"]),
        ("please put the blue cube away, the drawer is fine", "A", ["open drawer", "put_in blue drawer"]),
        (
            "put the gray cube in the drawer, and I'd rather not find it open afterwards",
            "B",
            ["put_in gray drawer", "close drawer"],
        ),
        (
            "put away the gray and the cyan cube, one in the fridge, the other in the drawer",
            "BF",
            ["put_in gray fridge", "put_in cyan drawer"],
        ),
        ("let me relieve you of the red cube", "D", ["hand_over red hand"]),
        ("put the yellow cube in the fridge super fast", "F", ["put_in yellow fridge"]),
        ("separate the two blocks that are stacked", "S", ["pick_and_place blue"]),
    ],
)
def test_what_is_meant_by_parts_of_a_sentence_together_is_done(sentence, state, steps):
    assert [each for each in done(sentence, state) if each in steps] == steps


def test_a_question_with_emphasis_or_politeness_is_answered():
    for sentence in ("where on earth is the yellow block?", "where is the yellow cube, if I may ask?"):
        assert "red fridge" in said(sentence, "K").text


@pytest.mark.parametrize("hand", [True, False])
def test_towards_me_is_away_from_the_robot_by_the_length_that_is_said(hand):
    scene = Scene(
        [Object("cube", "gray", (0.40, -0.05, 0.025)), *[Object("palm", "pink", (0.57, -0.4, 0.15))] * hand], "human"
    )
    world = table(scene, bounds=(0.32, 0.56, -0.3, 0.3))
    outcome = Dialogue().answer("shift the gray cube 4 cm towards me", world)
    assert isinstance(outcome, Plan), outcome
    assert outcome.steps[-1].place == pytest.approx((0.44, -0.05) if not hand else outcome.steps[-1].place, abs=0.005)
    assert all(step.verb != "hand_over" for step in outcome.steps)


def test_near_me_is_the_side_of_the_person_whoever_looks():
    for viewpoint in ("human", "robot"):
        world = table(Scene([Object("cube", "gray", (0.40, -0.05, 0.025))], viewpoint), bounds=(0.32, 0.56, -0.3, 0.3))
        outcome = Dialogue().answer("put the gray cube near me", world)
        assert outcome.steps[-1].place[0] > 0.5


def test_what_is_counted_is_known():
    assert "six (6)" in said("how many cubes are there in total?").text
    assert isinstance(said("how many degrees of freedom does this arm have?"), Refusal)


@pytest.mark.parametrize(
    ("sentence", "state", "steps"),
    [
        (
            "in the end I want to see the fridge shut with the cyan cube inside",
            "F",
            ["put_in cyan fridge", "close fridge"],
        ),
        ("once everything is done, the drawer is closed with gray in it", "B", ["put_in gray drawer", "close drawer"]),
        ("hey, could you check the fridge and take out whatever is in there", "I", ["take_out yellow fridge"]),
    ],
)
def test_a_container_and_what_is_in_it_are_wished_in_one_phrase(sentence, state, steps):
    assert done(sentence, state) == steps

"""Answers of the command line as text."""

from language.answers import underlined


def test_the_caret_is_under_the_position_of_the_error():
    assert underlined("reach\tthe bleu", 10) == ("reach the bleu", " " * 10 + "^")
    assert underlined("\x1b[2J的 x", 6)[1] == " " * 7 + "^"
    assert "\x1b" not in underlined("\x1b[2J", 0)[0]
    shown, caret = underlined("word " * 200_000, 500_000)
    assert len(shown) < 200
    assert shown[len(caret) - 1] == "w"

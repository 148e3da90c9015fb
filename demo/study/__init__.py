"""Studies with the page: participants by link, conditions in balanced order, questionnaires, and a log of everything.

It imports nothing itself.
"""

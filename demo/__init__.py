"""Interactive demo: a session with one robot that people instruct, and the user interfaces that show it."""

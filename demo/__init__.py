"""Talk to it, point at it: one robot that people direct, and the page in which they see it."""

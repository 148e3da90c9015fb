"""Commands as people write them: a wide-coverage understander, which grounds every reading in the scene.

The words are tables (`words`), the chart keeps every reading (`lattice`, `noun_phrases`, `chart`, `sentences`),
phrases are resolved in a `World` (`referents`, `relating`, `resolving`, `places`), readings become plans whose
preconditions are checked (`planning`), and the cheapest plan is chosen by one table of costs (`costs`, `choosing`,
`interpreting`).
"""

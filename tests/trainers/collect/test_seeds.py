"""Seeds of the parts of a run."""

from trainers.collect.worker import derive_seed, noise_seed


def test_seeds_of_training_and_evaluation_are_disjoint():
    trained = {derive_seed(s, i) for s in range(50) for i in range(50)}
    evaluated = {derive_seed(s, i, evaluation=True) for s in range(50) for i in range(50)}
    assert len(trained) == len(evaluated) == 2500
    assert max(trained) < min(evaluated) < 2**31


def test_every_worker_has_other_noise_in_every_iteration():
    assert len({noise_seed(s, worker, k) for s in range(5) for worker in range(5) for k in range(100)}) == 2500

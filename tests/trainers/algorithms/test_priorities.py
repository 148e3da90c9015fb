import pytest
import torch
from tensordict import TensorDict
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer

from trainers.algorithms.replay import ProportionalSampler


def buffer(errors, alpha=1.0, beta=1.0, capacity=8):
    """A buffer whose frames have these errors as priorities."""
    sampler = ProportionalSampler(capacity, alpha, beta, torch.device("cpu"))
    made = TensorDictReplayBuffer(storage=LazyTensorStorage(capacity), sampler=sampler)
    made.extend(TensorDict({"number": torch.arange(len(errors))}, [len(errors)]))
    made.update_priority(torch.arange(len(errors)), torch.tensor(errors))
    return made


@pytest.mark.parametrize(
    ("alpha", "shares"), [(1.0, (0.0, 0.25, 0.75)), (0.5, (0.0, 0.366, 0.634)), (0.0, (1 / 3,) * 3)]
)
def test_frames_are_drawn_in_proportion_to_their_errors_to_the_power_of_alpha(alpha, shares):
    torch.manual_seed(0)
    drawn = buffer([0.0, 1.0, 3.0], alpha).sample(20_000)["number"].bincount(minlength=3) / 20_000
    assert drawn.tolist() == pytest.approx(shares, abs=0.02)


def test_importance_weights_undo_the_priorities_and_are_at_most_one():
    torch.manual_seed(0)
    frames = buffer([1.0, 2.0, 4.0]).sample(100)
    expected = torch.tensor([1.0, 0.5, 0.25])[frames["number"]]
    assert torch.allclose(frames["priority_weight"], expected, atol=1e-6)


def test_a_new_frame_has_the_greatest_priority_so_far():
    frames = buffer([1.0, 5.0, 2.0])
    frames.update_priority(torch.tensor([1]), torch.tensor([0.5]))
    frames.extend(TensorDict({"number": torch.tensor([3])}, [1]))
    assert frames.sampler.priorities[:4].tolist() == pytest.approx([1.0, 0.5, 2.0, 5.0])


def test_a_frame_that_replaces_an_old_one_has_a_priority_of_its_own():
    frames = buffer([4.0] + [1.0] * 7)
    frames.update_priority(torch.tensor([0]), torch.tensor([0.0]))
    frames.extend(TensorDict({"number": torch.tensor([8])}, [1]))
    assert frames.sampler.priorities[0].item() == pytest.approx(4.0)


def test_the_state_is_saved_and_restored(tmp_path):
    one, other = buffer([1.0, 2.0, 4.0]).sampler, buffer([3.0]).sampler
    one.dumps(tmp_path / "sampler")
    other.loads(tmp_path / "sampler")
    assert torch.equal(one.priorities, other.priorities)
    assert other.state_dict()["greatest"] == one.state_dict()["greatest"]

"""The training of the network that sees: targets of cells, the loss, disturbed pictures, and the loop."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor
from torch.nn import functional

from envs.perception.network import CELL, HEIGHT_UNIT, PART, SIZE_UNIT, SightNetwork
from envs.perception.poses import CUBE, LEVER, WHEEL, wheel_starts
from envs.perception_training.scenes import LABEL, SEEN, Pictures
from language import FITTINGS, NOUNS

REACH = 1.5  # cells around the middle of a thing that learn what it is
WIDTH = 0.6  # cells, the standard deviation of the heat around a middle
COMMON = 0.5  # share of pictures that show a noun from which on it needs no repetition
COVERED = 3  # things in a picture that a box may cover in part
MOST_GRADIENT = 5.0  # norm of the gradients of a step
MOVED = [list(NOUNS).index(noun) for noun in ("button", "lever", *FITTINGS)]  # nouns whose share a cell tells
WEIGHTS = {"heat": 1.0, "offset": 0.5, "height": 0.5, "noun": 0.5, "color": 0.5, "size": 0.5, "target": 1.5}
WEIGHTS |= {"turn": 0.5, "share": 1.0}


def targets(labels: Tensor, cells: tuple[int, int]) -> dict[str, Tensor]:
    """Return what the cells of M pictures are to tell.

    Args:
        labels: (M, THINGS, len(LABEL)).
        cells: h and w.

    Returns:
        heat (M, h, w) in [0, 1]; weight (M, h, w), how much a cell learns what its thing is; heeded (M, h, w), 0 where
        the heat is not to be learned; label (M, h, w, len(LABEL)) of the thing that is nearest to each cell.
    """
    seen = labels[..., LABEL.index("state")]
    u = (torch.arange(cells[1], device=labels.device) + 0.5).view(1, 1, 1, -1)
    v = (torch.arange(cells[0], device=labels.device) + 0.5).view(1, 1, -1, 1)
    places = labels[..., :2] / CELL
    squares = (u - places[..., 0, None, None]) ** 2 + (v - places[..., 1, None, None]) ** 2  # (M, T, h, w)
    far = torch.full_like(squares, 1e6)
    things = torch.where((seen > 0)[..., None, None], squares, far)
    nearest, which = things.min(1)
    near_cell = ((u - places[..., 0, None, None]).abs() <= 0.5) & ((v - places[..., 1, None, None]).abs() <= 0.5)
    inside = (near_cell & (seen > 0)[..., None, None]).any(1)
    heat = torch.where(inside, torch.ones_like(nearest), torch.exp(-nearest / (2 * WIDTH**2)) * 0.99)
    ignored = torch.where((seen < 0)[..., None, None], squares, far).amin(1) < REACH**2
    index = which.flatten(1)[..., None].expand(-1, -1, labels.shape[-1])
    label = labels.gather(1, index).unflatten(1, cells)
    weight = torch.where(nearest < REACH**2, torch.exp(-nearest / (2 * 0.9**2)), torch.zeros_like(nearest))
    return {"heat": heat, "weight": weight, "heeded": (~ignored | inside).float(), "label": label, "inside": inside}


def losses(out: Tensor, labels: Tensor) -> dict[str, Tensor]:
    """Return the terms of the loss by name, before their weights. out: (M, WIDTH, h, w). labels: as in `targets`."""
    cells = {name: out[:, part].float() for name, part in PART.items()}
    size = (out.shape[2], out.shape[3])
    wanted = targets(labels, size)
    weight, label = wanted["weight"], {name: wanted["label"][..., i] for i, name in enumerate(LABEL)}
    total = weight.sum().clamp(min=1.0)

    def mean(values: Tensor, among: Tensor | None = None) -> Tensor:
        if among is None:
            return (values * weight).sum() / total
        chosen = weight * among
        return (values * chosen).sum() / chosen.sum().clamp(min=1.0)

    u = (torch.arange(size[1], device=out.device) + 0.5).view(1, 1, -1)
    v = (torch.arange(size[0], device=out.device) + 0.5).view(1, -1, 1)
    spread = cells["spread"].clamp(-5.0, 2.0)
    across = (cells["offset"][:, 0] - (label["u"] / CELL - u)).abs() + (
        cells["offset"][:, 1] - (label["v"] / CELL - v)
    ).abs()
    above = (cells["height"][:, 0] - label["height"] / HEIGHT_UNIT).abs()
    noun, color = label["noun"].long(), label["color"].long()
    terms = {
        "heat": _focal(cells["heat"][:, 0], wanted["heat"], wanted["heeded"]) / wanted["inside"].sum().clamp(min=1.0),
        "offset": mean(across / spread[:, 0].exp() + 2 * spread[:, 0] + across),
        "height": mean(above / spread[:, 1].exp() + spread[:, 1] + above),
        "noun": mean(functional.cross_entropy(cells["noun"], noun, reduction="none")),
        "color": mean(functional.cross_entropy(cells["color"], color, reduction="none")),
        "size": mean((cells["size"][:, 0] - label["size"] / SIZE_UNIT).abs()),
        "target": mean(
            functional.binary_cross_entropy_with_logits(cells["target"][:, 0], label["target"], reduction="none")
        ),
    }
    turn, wheel = label["turn"], noun == WHEEL
    other = torch.where(wheel, wheel_starts(turn, label["share"]), 4 * turn)  # where the mark of a wheel is
    aims = torch.stack((turn.cos(), turn.sin(), other.cos(), other.sin()), 1)
    wrong = (cells["turn"] - aims) ** 2
    faces = ((noun == LEVER) | wheel).float()
    terms["turn"] = mean(wrong[:, :2].sum(1), faces)
    terms["turn"] += mean(wrong[:, 2:].sum(1), (noun == CUBE).float()) + mean(wrong[:, 2:].sum(1), wheel.float())
    moved = torch.isin(noun, noun.new_tensor(MOVED)).float()
    terms["share"] = mean((cells["share"][:, 0] - label["share"]).abs(), moved)
    return terms


def _focal(logits: Tensor, heat: Tensor, heeded: Tensor) -> Tensor:
    """The focal loss of CenterNet: a cell near a middle is punished less for its heat."""
    likely = logits.sigmoid().clamp(1e-5, 1 - 1e-5)
    there = heat >= 1.0
    found = -((1 - likely) ** 2) * likely.log() * there
    other = -((1 - heat) ** 4) * likely**2 * (1 - likely).log() * ~there
    return ((found + other) * heeded).sum()


def disturb(pictures: Tensor, labels: Tensor, generator: torch.Generator) -> Tensor:
    """Return pictures (M, 3, H, W) in [0, 1] with other white balance, brightness, blur, noise, and covered things."""
    count, device = len(pictures), pictures.device

    def draw(low: float, high: float, *shape: int) -> Tensor:
        return low + (high - low) * torch.rand(count, *shape, device=device, generator=generator)

    def some(share: float) -> Tensor:
        return torch.rand(count, 1, 1, 1, device=device, generator=generator) < share

    pictures = _covered(pictures, labels, draw, some)
    gain = torch.where(some(0.6), draw(0.9, 1.1, 3, 1, 1), 1.0) * torch.where(some(0.5), draw(0.75, 1.2, 1, 1, 1), 1.0)
    pictures = (pictures * gain).clamp(0, 1)
    gray = pictures.mean(1, keepdim=True)
    pictures = torch.where(some(0.4), (gray + draw(0.65, 1.1, 1, 1, 1) * (pictures - gray)).clamp(0, 1), pictures)
    pictures = torch.where(some(0.5), pictures.clamp(min=1e-4) ** draw(0.6, 1.35, 1, 1, 1), pictures)
    pictures = torch.where(some(0.35), _blurred(pictures, draw(0.3, 1.1)), pictures)
    noise = torch.randn(pictures.shape, device=device, generator=generator) * draw(0.0, 0.05, 1, 1, 1)
    return torch.where(some(0.5), pictures + noise, pictures).clamp(0, 1)


def _covered(pictures: Tensor, labels: Tensor, draw: Callable[..., Tensor], some: Callable[[float], Tensor]) -> Tensor:
    """Cover about a third of some things with boxes of one colour."""
    height, width = pictures.shape[2:]
    u = torch.arange(width, device=pictures.device).view(1, 1, -1) + 0.5
    v = torch.arange(height, device=pictures.device).view(1, -1, 1) + 0.5
    each = torch.arange(len(labels), device=labels.device)
    for _ in range(COVERED):
        chosen = (draw(0.0, 8.0)).long()
        middle = labels[each, chosen, :2] + draw(-5.5, 5.5, 2)
        half = draw(1.0, 3.5, 2)
        mask = ((u - middle[:, 0, None, None]).abs() < half[:, 0, None, None]) & (
            (v - middle[:, 1, None, None]).abs() < half[:, 1, None, None]
        )
        pictures = torch.where(mask[:, None] & some(0.4), draw(0.0, 1.0, 3, 1, 1), pictures)
    return pictures


def _blurred(pictures: Tensor, widths: Tensor) -> Tensor:
    """Blur each picture (M, 3, H, W) by a Gaussian of its own width (M,), pixels."""
    steps = torch.arange(-2, 3, device=pictures.device).float()
    kernel = torch.exp(-(steps**2) / (2 * widths[:, None] ** 2))
    kernel = kernel / kernel.sum(1, keepdim=True)
    rows = kernel.repeat_interleave(3, 0)[:, None, None, :]
    flat = pictures.flatten(0, 1)[None]
    flat = functional.conv2d(functional.pad(flat, (2, 2, 0, 0), mode="replicate"), rows, groups=len(rows))
    columns = rows.transpose(2, 3)
    flat = functional.conv2d(functional.pad(flat, (0, 0, 2, 2), mode="replicate"), columns, groups=len(rows))
    return flat[0].unflatten(0, (len(pictures), 3))


def fit(
    pictures: Pictures,
    *,
    steps: int,
    batch: int = 48,
    learning_rate: float = 2.5e-3,
    seed: int = 0,
    device: str = "cpu",
    bfloat16: bool = True,
    init: SightNetwork | None = None,
    report: Callable[[int, dict[str, float]], None] | None = None,
) -> SightNetwork:
    """Train a network, from scratch or from `init`. The same arguments give the same bits on one machine.

    Args:
        pictures: to learn from.
        steps: of the optimiser.
        batch: pictures of each step.
        learning_rate: the highest of the one-cycle schedule.
        seed: of the network, the order of the pictures and their disturbances.
        device: "cpu" or "cuda".
        bfloat16: compute convolutions in 16 bits.
        init: a network to begin with, which is changed.
        report: is called now and then with the step and the terms of the loss.
    """
    torch.manual_seed(seed)
    network = (init or SightNetwork()).to(device).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    optimizer = torch.optim.AdamW(network.parameters(), lr=learning_rate, weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, learning_rate, total_steps=steps, pct_start=0.1)
    generator = torch.Generator(device).manual_seed(seed)
    order_source = torch.Generator().manual_seed(seed)
    arrays = pictures.pictures, pictures.cameras, pictures.labels
    data, cameras, labels = (torch.from_numpy(array).to(device) for array in arrays)
    order, repeats = torch.empty(0, dtype=torch.long), _repeats(torch.from_numpy(pictures.labels))
    network.train()
    for step in range(steps):
        if len(order) < batch:
            order = torch.cat((order, _epoch(repeats, order_source)))
        chosen, order = order[:batch].to(data.device), order[batch:]
        these = labels[chosen]
        inputs = data[chosen].permute(0, 3, 1, 2).float().div_(255)
        inputs = disturb(inputs, these, generator).to(memory_format=torch.channels_last)
        with torch.autocast(device, torch.bfloat16, enabled=bfloat16):
            out = network(inputs, cameras[chosen])
        terms = losses(out, these)
        _update(network, optimizer, terms)
        schedule.step()
        if report is not None and (step % 50 == 0 or step == steps - 1):
            report(step, {name: float(term.detach()) for name, term in terms.items()})
    return network.eval()


def _repeats(labels: Tensor) -> Tensor:
    """Return how often an epoch shows each picture, (M,): more often where it shows a noun that few pictures show.

    Source: Gupta, Dollar and Girshick, "LVIS", 2019, appendix: repeat factor sampling.
    """
    shown = torch.zeros(len(labels), len(NOUNS))
    seen = (labels[..., LABEL.index("state")] == SEEN).float()
    shown.scatter_add_(1, labels[..., LABEL.index("noun")].long(), seen).clamp_(max=1.0)
    factors = (COMMON / shown.mean(0).clamp(min=1e-4)).sqrt().clamp(min=1.0)
    return (shown * factors).amax(1).clamp(min=1.0)


def _epoch(repeats: Tensor, generator: torch.Generator) -> Tensor:
    """Return the numbers of pictures in a random order, each `repeats` (M,) times on average."""
    counts = (repeats + torch.rand(len(repeats), generator=generator)).long()
    chosen = torch.arange(len(repeats)).repeat_interleave(counts)
    return chosen[torch.randperm(len(chosen), generator=generator)]


def _update(network: SightNetwork, optimizer: torch.optim.Optimizer, terms: dict[str, Tensor]) -> None:
    loss = torch.stack([WEIGHTS[name] * term for name, term in terms.items()]).sum()
    optimizer.zero_grad(set_to_none=True)
    loss.backward()
    torch.nn.utils.clip_grad_norm_(network.parameters(), MOST_GRADIENT)
    optimizer.step()

"""Proportions of a person, and the meshes of their body as lists of elliptic rings."""

from __future__ import annotations

from dataclasses import dataclass

from human.body.shapes import Ring

CONE_LENGTH, CONE_RADIUS = 0.35, 0.04  # metres, of the cone that is drawn along the finger

# Meshes of a person 1.75 m tall, as rings. Heights of the torso and the legs are measured from the floor, those of the
# head from its joint.
RINGS: dict[str, list[Ring]] = {
    "shirt": [
        (0.9, 0.1, 0.158, 0), (0.91, 0.112, 0.166, 0), (1.0, 0.106, 0.152, 0),
        (1.1, 0.104, 0.148, 0), (1.22, 0.115, 0.165, 0), (1.32, 0.118, 0.178, 0),
        (1.39, 0.104, 0.186, -0.005), (1.43, 0.09, 0.183, -0.01), (1.452, 0.076, 0.155, -0.014),
        (1.475, 0.066, 0.105, -0.015), (1.492, 0.06, 0.066, -0.012),
    ],
    "pelvis": [
        (0.76, 0.03, 0.05, 0), (0.79, 0.085, 0.12, 0), (0.84, 0.104, 0.158, 0),
        (0.9, 0.104, 0.16, 0), (0.95, 0.1, 0.15, 0),
    ],
    "leg": [
        (0.05, 0.048, 0.048, -0.01), (0.06, 0.054, 0.052, -0.01), (0.3, 0.064, 0.06, -0.012),
        (0.47, 0.062, 0.06, 0.004), (0.7, 0.082, 0.078, 0), (0.85, 0.092, 0.082, 0),
    ],
    "shoe": [
        (0, 0.125, 0.042, 0.055), (0.01, 0.138, 0.05, 0.055), (0.035, 0.132, 0.048, 0.055),
        (0.06, 0.1, 0.044, 0.028), (0.09, 0.06, 0.042, -0.008), (0.1, 0.05, 0.038, -0.01),
    ],
    "neck": [(1.42, 0.06, 0.062, -0.012), (1.49, 0.054, 0.054, -0.004), (1.57, 0.052, 0.052, 0.004)],
    "face": [
        (0.012, 0.02, 0.018, 0.052), (0.02, 0.034, 0.032, 0.048), (0.045, 0.062, 0.05, 0.026),
        (0.085, 0.084, 0.066, 0.01), (0.14, 0.095, 0.074, 0), (0.19, 0.093, 0.073, -0.002),
        (0.225, 0.074, 0.06, -0.004), (0.245, 0.04, 0.034, -0.004),
    ],
    "hair": [
        (0.05, 0.05, 0.045, -0.045), (0.08, 0.074, 0.066, -0.03), (0.13, 0.087, 0.08, -0.022),
        (0.18, 0.096, 0.081, -0.012), (0.2, 0.103, 0.08, -0.001), (0.23, 0.086, 0.07, -0.002),
        (0.255, 0.055, 0.046, -0.004), (0.262, 0.02, 0.016, -0.004),
    ],
    "nose": [(0.095, 0.006, 0.012, 0.1), (0.1, 0.013, 0.014, 0.1), (0.145, 0.006, 0.007, 0.09)],
    "ear": [(0.095, 0.008, 0.006, 0), (0.11, 0.015, 0.01, -0.002), (0.14, 0.018, 0.011, -0.005),
            (0.155, 0.01, 0.007, -0.005)],
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Proportions:
    """Measures of a person.

    height: metres. Lengths and widths are shares of the height, from Drillis and Contini, "Body Segment Parameters",
    1966. girth: factor of the limbs' thickness. mass: kg. Colours are RGB in [0, 1].
    """

    height: float = 1.75
    shoulder_height: float = 0.806  # height and width are those of the joints, a little less than the bones' ends
    shoulder_width: float = 0.222
    upper_arm: float = 0.186
    forearm: float = 0.146
    hand: float = 0.108  # from the wrist to the fingertip
    torso_width: float = 0.195
    girth: float = 1.0
    mass: float = 70.0
    skin: tuple[float, float, float] = (0.87, 0.67, 0.54)
    shirt: tuple[float, float, float] = (0.25, 0.42, 0.62)
    trousers: tuple[float, float, float] = (0.2, 0.21, 0.26)
    shoes: tuple[float, float, float] = (0.12, 0.1, 0.09)
    hair: tuple[float, float, float] = (0.22, 0.14, 0.09)


def meshes(p: Proportions) -> dict[str, list[Ring]]:
    """Returns the rings of every mesh, by the stem of its file name."""
    s, w = p.height / 1.75, p.torso_width / 0.2
    widths = {"shirt": w, "pelvis": w}
    scaled = {
        name: [(s * z, s * a, s * widths.get(name, 1) * b, s * x) for z, a, b, x in rings]
        for name, rings in RINGS.items()
    }
    cone: list[Ring] = [(-CONE_LENGTH, CONE_RADIUS, CONE_RADIUS, 0), (0, 0.001, 0.001, 0)]
    return scaled | _arm_meshes(p) | {"cone": cone}


def _arm_meshes(p: Proportions) -> dict[str, list[Ring]]:
    s, upper, fore = p.height / 1.75 * p.girth, p.height * p.upper_arm, p.height * p.forearm
    h = p.height * p.hand / 0.189
    return {
        "sleeve": [
            (-0.56 * upper, 0.05 * s, 0.049 * s, 0), (-0.54 * upper, 0.055 * s, 0.053 * s, 0),
            (-0.25 * upper, 0.059 * s, 0.056 * s, 0), (0, 0.062 * s, 0.057 * s, 0), (0.03 * s, 0.05 * s, 0.046 * s, 0),
            (0.045 * s, 0.03 * s, 0.026 * s, 0), (0.05 * s, 0.008 * s, 0.008 * s, 0),
        ],
        "upper_arm": [
            (-upper - 0.036 * s, 0.014 * s, 0.014 * s, 0), (-upper - 0.024 * s, 0.03 * s, 0.03 * s, 0),
            (-upper, 0.039 * s, 0.039 * s, 0), (-0.8 * upper, 0.041 * s, 0.041 * s, 0),
            (-0.5 * upper, 0.047 * s, 0.046 * s, 0),
        ],
        "forearm": [
            (-fore - 0.01, 0.022 * s, 0.018 * s, 0), (-fore, 0.027 * s, 0.021 * s, 0),
            (-0.8 * fore, 0.028 * s, 0.024 * s, 0), (-0.3 * fore, 0.043 * s, 0.041 * s, 0),
            (-0.08 * fore, 0.041 * s, 0.04 * s, 0), (0.02 * s, 0.033 * s, 0.033 * s, 0),
            (0.036 * s, 0.012 * s, 0.012 * s, 0),
        ],
        "palm": [
            (-0.103 * h, 0.03 * h, 0.008 * h, -0.002), (-0.095 * h, 0.041 * h, 0.013 * h, -0.002),
            (-0.06 * h, 0.042 * h, 0.015 * h, 0), (-0.025 * h, 0.034 * h, 0.017 * h, 0),
            (0, 0.026 * h, 0.019 * h, 0), (0.015 * h, 0.022 * h, 0.016 * h, 0),
        ],
    }  # fmt: skip

"""Seeing: what stands where, from the pictures of calibrated cameras."""

from envs.perception.config import PerceptionConfig
from envs.perception.detections import Detections, Detector, UnusablePicture, View

__all__ = ["Detections", "Detector", "PerceptionConfig", "UnusablePicture", "View"]

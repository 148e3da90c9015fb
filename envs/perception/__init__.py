"""Seeing: what stands where, from the pictures of calibrated cameras."""

from envs.perception.detections import Detections, Detector, View

__all__ = ["Detections", "Detector", "View"]

"""Collection of experience: in this process, in worker processes or on a cluster."""

from __future__ import annotations

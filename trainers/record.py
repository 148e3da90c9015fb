"""`python -m trainers.record`, by another name than `python record.py`: that program knows the environments, which no
room below it does. This one hands over to it, as a sweep's jobs are handed to train.py.
"""

from __future__ import annotations

import runpy

if __name__ == "__main__":
    runpy.run_module("record", run_name="__main__", alter_sys=True)

"""The files of the page of a trial."""

from __future__ import annotations

from demo.page_files import POLICY, PageFiles
from demo.study.study_config import ConditionConfig

FRAME = "frame-ancestors 'self'"  # the page is in a frame of the study's


class TrialFiles(PageFiles):
    """The files of the page, which a study's page has in a frame, without what the condition lacks."""

    def __init__(self, condition: ConditionConfig) -> None:
        super().__init__()
        looks = [
            "study",
            condition.input,
            *["silent"] * (not condition.answers),
            *["bare"] * (not condition.suggestions),
        ]
        page = self._own["index.html"].decode()
        page = page.replace("</head>", '<link rel="stylesheet" href="study_task.css">\n</head>')
        self._own["index.html"] = page.replace("<body>", f'<body class="{" ".join(looks)}">').encode()

    def get(self, path: str) -> tuple[bytes, dict[str, str]] | None:
        found = super().get(path)
        if found is None:
            return None
        policy = POLICY.replace("frame-ancestors 'none'", FRAME)
        return found[0], found[1] | {"Content-Security-Policy": policy, "X-Frame-Options": "SAMEORIGIN"}

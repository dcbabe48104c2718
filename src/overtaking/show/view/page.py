"""The page as one file: markup, style, script and data, nothing loaded from anywhere."""

from __future__ import annotations

import base64
import hashlib
import json
import zlib
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from overtaking.knowledge.glossary import terms
from overtaking.knowledge.toml_reader import constant
from overtaking.labels.law.judging import STORED_POLICIES
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.show.palette import ACCENT, CLASS_COLOURS, CLASS_MARKERS, GRID, INK, QUIET
from overtaking.show.video import palette
from overtaking.show.video.jobs import MIN_DURATION_S

if TYPE_CHECKING:
    from collections.abc import Sequence

    from overtaking.model.import_report import ImportFinding

THEMES = {
    "light": {
        "ground": "#ffffff",
        "panel": "#f6f7f9",
        "ink": INK,
        "quiet": QUIET,
        "line": GRID,
        "edge": "#868e98",
        "accent": ACCENT,
        "ego": ACCENT,
        "target": "#a85f00",
        "breach": "#b94a00",
        "branch": "#a0407a",
        "kept": "#00785a",
        "aside": "#5f6670",
    },
    "dark": {
        "ground": palette.INK,
        "panel": palette.PANEL,
        "ink": palette.TEXT,
        "quiet": palette.FAINT,
        "line": palette.GRID,
        "edge": "#6b7682",
        "accent": palette.EGO,
        "ego": palette.EGO,
        "target": palette.TARGET,
        "breach": "#ff8147",
        "branch": "#f092c6",
        "kept": "#2bc59a",
        "aside": "#8d98a4",
    },
}
"""Colours of the page: those of figures, and those of films; some darker or lighter, so that text
has a contrast of 4.5 and lines one of 3 with the ground (WCAG 2.2, 1.4.3 and 1.4.11)."""

_RULE_FIELDS = {
    "title": "title",
    "law": "article",
    "gloss": "gloss",
    "predicate": "predicate",
    "unit": "unit",
    "of_ego": "is_duty_of_ego",
}
"""The values of a rule that the page shows: the key in the page, and the field of `Rule`."""

MAX_FINDINGS = 200
"""Findings of an import report that a page shows; a table of more rows is slow to lay out."""

_COMPRESSION = 9
_VIEWPORT = (
    '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
    '<meta name="color-scheme" content="light dark">\n<link rel="icon" href="data:,">\n'
)
_NO_SCRIPT = (
    "<noscript>This page draws simulations with JavaScript, which is switched off.</noscript>\n"
)


def packed(values: dict[str, Any]) -> str:
    """Values as text: JSON, compressed (zlib), in base64."""
    text = json.dumps(values, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return base64.b64encode(zlib.compress(text.encode(), _COMPRESSION)).decode("ascii")


def words() -> dict[str, Any]:
    """The words and colours that the page shares with figures, films and the terminal."""
    classes = terms("classes")
    return {
        "classes": {
            name: {
                "title": classes[name].title,
                "meaning": classes[name].meaning,
                "colour": colour,
                "marker": CLASS_MARKERS[name],
            }
            for name, colour in CLASS_COLOURS.items()
        },
        "policies": {
            one.name: {"meaning": terms("policies")[one.name].meaning, "required": one.required}
            for one in STORED_POLICIES
        },
        "rules": {
            rule.code: {key: getattr(rule, field) for key, field in _RULE_FIELDS.items()}
            for rule in PORTUGAL.rules
        },
        "critical_ttc_s": float(constant("event_detection.safety.critical_ttc")),
        "min_duration_s": MIN_DURATION_S,
        "stages": {
            stage.name: {"title": title, "colour": colour, "ink": ink}
            for stage, (title, colour, ink) in palette.STAGES.items()
        },
        "themes": THEMES,
        "road": {
            "ego": palette.EGO,
            "target": palette.TARGET,
            "branch": THEMES["dark"]["branch"],
            "brake": palette.BRAKE_ON,
            "indicator": palette.INDICATOR_ON,
            "tail": palette.TAIL_ON,
            "lamp": palette.LAMP_ON,
            "glass": palette.GLASS,
            "flash": palette.FLASH,
        },
    }


def report_values(findings: Sequence[ImportFinding]) -> dict[str, Any]:
    """The first findings of an import report, and the number of all.

    Args:
        findings: The rows of the report.
    """
    rows = [finding.to_dict() for finding in findings[:MAX_FINDINGS]]
    return {"rows": rows, "num_rows": len(findings)}


def page(
    title: str,
    policy: str,
    simulations: Sequence[dict[str, Any]],
    findings: Sequence[ImportFinding] = (),
) -> str:
    """The whole page.

    Args:
        title: Title, such as the name of a data set.
        policy: Which policy is chosen when it opens.
        simulations: One entry for each: what the list shows, and `data`, its text of `packed`.
        findings: The rows of the import report of the simulations.
    """
    here = files("overtaking.show.view")
    script, style = (
        here.joinpath(name).read_text(encoding="utf-8") for name in ("viewer.js", "viewer.css")
    )
    data = {
        "title": title,
        "policy": policy,
        "words": words(),
        "import_report": report_values(findings),
        "simulations": list(simulations),
    }
    # Without "<" no text in it can end the element that it lies in.
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
    rules = (
        f"default-src 'none'; script-src {_hash(script)}; style-src {_hash(style)}; "
        "img-src data:; base-uri 'none'; form-action 'none'"
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{rules}">\n'
        f"{_VIEWPORT}<title>{escape(title)} · overtaking</title>\n<style>{style}</style>\n"
        f"</head>\n<body>\n{_NO_SCRIPT}"
        f'<script type="application/json" id="data">{text}</script>\n'
        f'<script type="module">{script}</script>\n</body>\n</html>\n'
    )


def shell() -> str:
    """The page of a server, which asks for its data, script and style itself."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'{_VIEWPORT}<link rel="stylesheet" href="viewer.css">\n'
        f"<title>overtaking</title>\n</head>\n<body>\n{_NO_SCRIPT}"
        '<script type="module" src="viewer.js"></script>\n</body>\n</html>\n'
    )


def _hash(text: str) -> str:
    """What lets the page's own text through its content security policy, and nothing else."""
    digest = hashlib.sha256(text.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"

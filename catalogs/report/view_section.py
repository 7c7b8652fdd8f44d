"""The section of the view that can be turned: what the page writes around the view, and the scripts that draw it."""

import base64
import hashlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray as xr

from catalogs.figures import events_figure, style
from catalogs.report.inputs import MODEL_LABEL, Evidence
from catalogs.report.text import fixed, plural, whole
from catalogs.report.view_data import NEVER, PIXELS_PER_POINT, PLANNED, event_steps, shown_events, view_data
from common.event_table import new_catalog

SCRIPTS = [Path(__file__).parent / "browser" / name for name in ("three.min.js", "view.js")]  # in order
POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"


def section(evidence: Evidence, shown: Mapping[str, xr.Dataset]) -> dict | None:
    """What the page shows of the view; None for a mine in a plane, and for one without steps.

    shown: the catalogues that have events, by label.
    """
    if int(evidence.grid.attrs["dimension"]) == 2 or not evidence.steps:
        return None
    none = {MODEL_LABEL: new_catalog(0, {"mine": evidence.grid.attrs["mine"], "kind": "synthetic"})}
    catalogues = none | dict(shown)
    data = view_data(evidence, catalogues)
    scale = events_figure.common_scale(list(catalogues.values()))
    low, high = (float(np.floor(10 * bound) / 10) for bound in scale.log_potency)
    return {
        "data": data,
        "scripts": [path.read_text(encoding="utf-8") for path in SCRIPTS],
        "titles": list(catalogues),
        "has_events": bool(shown),
        "least": {"low": low, "high": high},
        "key_steps": style.thinned(data["steps"]),
        "key_sizes": [
            {"label": f"log P {fixed(value, 1)}", "pixels": PIXELS_PER_POINT * float(scale.diameter(value))}
            for value in (scale.key_sizes if shown else [])
        ],
        "colours": data["colours"],
        "filled": any(one["filled"] != NEVER for one in data["openings"]),
        "planned": any(one["step"] == PLANNED for one in data["openings"]),
        "notes": [note for label, one in catalogues.items() if (note := _left_out(evidence, label, one))],
    }


def content_security_policy(scripts: list[str]) -> str:
    """What the browser lets the page do: run these scripts, show images that it contains, and ask no address."""
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    return f"{POLICY}; script-src " + (" ".join(f"'sha256-{digest}'" for digest in digests) or "'none'")


def _left_out(evidence: Evidence, label: str, catalog: xr.Dataset) -> str:
    """Which events of a catalogue the view leaves out, in a sentence; empty where it shows all."""
    undated = int(np.count_nonzero(event_steps(evidence, catalog) < 0))
    small = catalog.sizes["event"] - undated - len(shown_events(evidence, catalog))
    parts = [f"{plural(undated, 'event')} outside of the dates of the steps"] if undated else []
    parts += [f"the {whole(small)} smallest"] if small else []
    return f"{label}: the view leaves out {' and '.join(parts)}." if parts else ""

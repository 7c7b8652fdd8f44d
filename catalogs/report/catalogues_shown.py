"""Which events of both catalogues the report shows, and which of them the comparison's numbers are of."""

import numpy as np

from catalogs.report import text
from catalogs.report.inputs import MODEL_LABEL, Evidence


def shown_catalogues(evidence: Evidence) -> dict:
    """Catalogues that have events to show, by label: the modelled one first."""
    found = {} if evidence.catalog is None else {MODEL_LABEL: evidence.resolved}
    if evidence.record is not None:
        found[evidence.record_label] = evidence.record
    return found if any(catalog.sizes["event"] for catalog in found.values()) else {}


def compared_events(evidence: Evidence, shown: dict) -> dict[str, np.ndarray]:
    """Which events (event,) of each catalogue shown the comparison's numbers are of; all where nothing is compared."""
    comparison = evidence.comparison
    found = {label: np.ones(catalog.sizes["event"], bool) for label, catalog in shown.items()}
    if comparison is None or not comparison["events_above_cut"].values.all():
        return found
    used = {name: comparison[f"{name}_used"].values == 1 for name in ("model", "record")}
    both = (evidence.catalog, evidence.record)
    if any(one is None or one.sizes["event"] != len(chosen) for one, chosen in zip(both, used.values(), strict=True)):
        return found  # a comparison of other catalogues: a banner says so
    used["model"] = used["model"][evidence.catalog["resolved"].values == 1]
    return {label: used["model" if label == MODEL_LABEL else "record"] for label in shown}


def selection(compared: dict[str, np.ndarray]) -> str:
    """How many of the events shown are compared; empty where all are."""
    if all(chosen.all() for chosen in compared.values()):
        return ""
    counts = [
        f"{text.whole(chosen.sum())} of {text.whole(len(chosen))} {label[0].lower()}{label[1:]}"
        for label, chosen in compared.items()
    ]
    return f"{' and '.join(counts)} events are compared: from the cut on, in the time that both catalogues share."
